"""Of a block and the values from which an adjustment starts."""
