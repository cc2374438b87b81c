"""Thresholds of tables and of what arrays are made of, each once, with its source."""

import numpy as np

# --- bundle tables

PREDICTED_REDUNDANCY = 1e-6
"""Redundancy in every direction from which on the others predict a control point."""

# --- candidate groups

FEWEST_OF_UNIT = 3
"""Observations of a unit: fewer are single ones."""

# --- feature tracks

SMALLEST_PX = 4.0
"""Diameter up to which features are as good as small ones get."""

# --- corrections

LARGE_AT_CORNER = 0.05
"""A distortion above this share of the corner's distance may have been meant the other way round."""

# --- heights

MOST_TILT_RAD = np.deg2rad(5.0)
"""Up to this tilt the closed forms for vertical images serve."""

# --- strip tables

BEYOND_CONTROL = 2**0.5 - 1
"""Share of the half range of a strip by which points may lie beyond its control and ties: there a polynomial of the
second degree, 2 u^2 - 1 in the worst case, has three times the error that it has within."""

BEYOND_ALL_CONTROL = 0.5
"""Of the same, beyond all control of the block."""
