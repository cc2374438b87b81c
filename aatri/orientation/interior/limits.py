"""Thresholds of interior orientation, each once, with its source."""

# --- fiducial fit

ILL_PLACED = 1e-6
"""Smallest eigenvalue over the largest, of the normal matrix of marks reduced to extent 1, that still determines it."""

# --- mark tests

INSEPARABLE_MARKS = 0.99
"""Two marks whose residuals correlate by more cannot be told apart."""

UNCONTROLLED = 1e-6
"""Eigenvalue of R_i of a fiducial mark below which an error of it in this direction does not show."""

SCALE_TOLERANCE = 0.02
"""Largest difference of the scale of an image by its fiducial marks from the nominal scale."""

WRONG_MARK = 0.02
"""Residual of a fiducial mark, as a share of the marks' extent, above which it is no measuring error but a wrong
mark."""
