"""Thresholds of cameras and their parameters, each once, with its source."""

import numpy as np

# --- advice

WARNED_CORRELATION = 0.95
"""Correlations of two camera parameters from here on are worth a warning."""

NOT_DETERMINABLE = 0.999
"""Correlation from which on two camera parameters cannot be told apart without a weight on one of them."""

IS_OF_KIND = 0.99
"""An additional parameter is of a kind (radial, affine ...) if so much of the square of its column lies in what the
kind spans."""

# --- calibrations of two blocks

SAME_NOMINAL_MM = 1e-6
"""Nominal values and formats of the cameras of two blocks are the same within this, mm."""

# --- vertical planes

FLATTEST_RAD = np.deg2rad(80.0)
"""Largest angle of a ray from the nadir: of flatter ones refraction and curvature of the earth are not corrected."""
