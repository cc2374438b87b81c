"""Of the result of a stage."""
