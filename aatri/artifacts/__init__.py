"""The six kinds of artifact that stages exchange."""
