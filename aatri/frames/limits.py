"""Thresholds of frames, each once, with its source."""

OUTSIDE_DEG = 5.0
"""A block this far outside of where its CRS is used is not there."""

SURE_CONFIDENCE = 60
"""Confidence in per cent from which on a code of the EPSG is taken for the map."""
