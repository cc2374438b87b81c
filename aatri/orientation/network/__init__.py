"""Approximate coordinates of geodetic networks."""
