"""What a page shows of a run, and how its numbers are written."""
