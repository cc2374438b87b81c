"""Thresholds of image refinement, each once, with its source."""

# --- collocation

FEWEST_CELLS = 12
"""Cells of the image with residuals below which no covariance function is fitted."""

# --- flying height

LEAST_EXTENT = 0.1
"""Diagonal of the points in the image, as a share of the principal distance, that gives a scale."""
