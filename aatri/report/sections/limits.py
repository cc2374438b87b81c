"""Thresholds of what the sections of a report show, each once, with its source."""

STRONG_CORRELATION = 0.5
"""Correlations of parameters below this are left out of their table."""

LEAST_REDUNDANCY_OF_CLASS = 1.0
"""Of a class of observations, from which on its standard deviation a posteriori is told."""
