"""Geodetic observations between stations: a file per type, and what they share."""
