"""Coordinate systems of the object space."""
