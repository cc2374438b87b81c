"""Thresholds of tables and of what arrays are made of, each once, with its source."""

import numpy as np

# --- bundle tables

PREDICTED_REDUNDANCY = 1e-6
"""Redundancy of a control point in every direction from which on the other observations predict it."""

# --- candidate groups

FEWEST_OF_UNIT = 3
"""Observations of a unit (camera, flight, image) that are tested as a group: fewer are single ones."""

# --- feature tracks

SMALLEST_PX = 4.0
"""Diameter of a feature up to which its position is as good as that of small ones gets."""

# --- corrections

LARGE_AT_CORNER = 0.05
"""A correction of distortion above this share of the corner's distance may have been meant the other way round."""

# --- heights

MOST_TILT_RAD = np.deg2rad(5.0)
"""Tilt of images up to which the closed forms for vertical images serve."""

# --- strip tables

BEYOND_CONTROL = 2**0.5 - 1
"""Share of the half range of a strip by which points may lie beyond its control and ties: there a polynomial of the
second degree, 2 u^2 - 1 in the worst case, has three times the error that it has within."""

BEYOND_ALL_CONTROL = 0.5
"""Share of the half range of a strip by which points may lie beyond all control of the block."""
