"""Compiled geometry, one item at a time, for the inner loops of the methods."""
