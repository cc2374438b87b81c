"""Thresholds of frames, each once, with its source."""

OUTSIDE_DEG = 5.0
"""A block this far outside of where its CRS is used is not there: the CRS is another one."""

SURE_CONFIDENCE = 60
"""Confidence in per cent with which a CRS matches a code of the EPSG, from which on that code is taken for it."""
