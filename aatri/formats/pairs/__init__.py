"""Pair files of student programs: interior elements and point pairs."""
