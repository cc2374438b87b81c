"""Text files, CSV tables and numbers, every cell with its file, line and column."""
