"""Thresholds of interior orientation, each once, with its source."""

# --- fiducial fit

ILL_PLACED = 1e-6
"""Smallest eigenvalue over the largest, of the normal matrix of marks reduced to extent 1, that still determines it."""

# --- mark tests

INSEPARABLE_MARKS = 0.99
"""Two marks whose residuals correlate by more cannot be told apart."""

UNCONTROLLED = 1e-6
"""A smaller eigenvalue of R_i means that an error in this direction does not show."""

SCALE_TOLERANCE = 0.02
"""Largest difference from the nominal scale."""

WRONG_MARK = 0.02
"""A residual above this share of the marks' extent is no measuring error but a wrong mark."""
