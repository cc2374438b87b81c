"""Thresholds of what is said of data and results, each once, with its source or the campaign that chose it.

A threshold that stands for a test is none: the test is made, with its false-alarm rate and the number of tests
(`aatri.adjustment.statistics.limits`).
"""

from __future__ import annotations

# --- after: weak datum

WEAK_DATUM = 10.0
"""Standard deviations of points over what an image point measures on the ground. Regular blocks with control at their
edges have 1 to 4, whatever their size (Ackermann 1966; Ebner 1972)."""

WEAK_SHARE = 0.95
"""The quantile of the standard deviations of all points that is held against it: a few weak points are no matter."""
