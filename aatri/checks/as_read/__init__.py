"""Of a block as it was read, before any method has run."""
