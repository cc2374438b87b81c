"""Thresholds of evaluations, each once, with its source."""

# --- doming

FEWEST_FOR_DOMING = 6
"""Points that determine the bend of heights, with its plane."""

ROUNDED_BEND_M = 1e-6
"""Smaller bends are rounding."""

# --- epochs

LEAST_FOR_ALIGNMENT = 3
"""Points that determine a similarity between two epochs."""

SAME_EPOCH = 1e-6
"""Share of the smallest detectable displacement below which all differences of two epochs are rounding: no two surveys
agree so."""

# --- field layout

INSIDE_SHARE = 0.9
"""Share of an axis of the block between the 5th and the 95th percentile of its points; the rest falls to the outer
cells."""

# --- free strips

FIRST_OF_GROWTH = 4
"""From this model of a strip on, the exponent of growth of its errors is fitted: the law is a power only for large
n."""

# --- ray pairs

FEWEST_OF_MODEL = 6
"""Common points from which on two images are a single model."""

ACROSS_BASE = 0.1
"""Length across the base of the viewing directions of both images together, from which on one side of the base is
up."""

LEAST_BASE = 1e-3
"""Base of two images, as a share of the distance of their points: images from one place, as of a rig, are no model."""

# --- verdict

ENOUGH_CHECK_POINTS = 30
"""Check points that a statement of accuracy needs: ASPRS Positional Accuracy Standards, edition 2 (2023), 7.11."""
