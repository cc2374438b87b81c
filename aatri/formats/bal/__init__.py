"""BAL problem files: reader and writer."""
