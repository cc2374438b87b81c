"""Thresholds of the orientation of a single image by known points, each once, with its source."""

# --- start

FEWEST_LINEAR = 6
"""Known points of an image that determine the linear transformation of eleven parameters."""

FLAT_POINTS = 1e-3
"""Points whose least spread is below this times the largest lie in a plane, for which the transformation is open."""

WIDE_RAD = 0.03
"""Known points farther than this from where they are seen do not fit an image: a start may be off by as much."""

LEAST_FITTING = 0.4
"""Share of the known points that an orientation of an image fits, below which it is none."""

FEW_POINTS = 5
"""Known points of an image up to which two orientations may see all: a second one is looked for."""

OTHER_ORIENTATION, CLEARLY_WORSE = 0.05, 3.0
"""Orientations apart by this share of the distance of their points are different; the second best of them has to fit
worse by this factor, or nothing tells them apart."""
