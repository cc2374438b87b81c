"""Models to strips: scale transfer along a chain of models."""
