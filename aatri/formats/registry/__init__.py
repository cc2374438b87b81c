"""The list of formats, and which of them a file is of."""
