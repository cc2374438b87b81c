"""Thresholds of files, each once, with its source."""

import numpy as np

# --- ways

MOST_OFF_PX = 5.0
"""Points of an adjusted block are off by some pixels at most."""

CLEARLY_BETTER = 2.0
"""Misfit of any other way over that of one which fits."""

FEWEST_DECIDING = 6
"""Fewest measured points that decide."""

# --- poses

ALONG_FLIGHT = 0.9
"""Mean of cos 4(h - a) that a flight has: images turned against it by up to 6 degrees."""

APART_SENSES = 0.1
"""What the other sense must be worse by, to be told from it: 4 degrees of azimuth."""

FEWEST_NEIGHBOURS = 3
"""Fewest pairs of neighbours that decide."""

LONG_STEP = 2.0
"""A step longer than so many times the median leads to another line."""

NOT_ORTHOGONAL = 1e-3
"""What R R' may differ from the identity by: matrices are written with six decimals or more, some with four."""

# --- reader

LARGEST_ASPECT_PX = 0.1
"""Pixels that are not square by more than this, at the edge of the format, are warned of where they count as square."""

# --- merged

FEWEST_SHIFTED = 3
"""Points whose common shift is no chance."""

SAME_SHIFT = 0.01
"""Share of a shift by which two datums may differ from point to point: they are turned and scaled, too."""

# --- layers

STEEPEST = 0.1
"""Least cosine between a ray of a footprint and the vertical: flatter ones end at the horizon."""

# --- reader

SAME_FOCAL_MM = 1e-3
"""A focal length beside an orientation that differs by more is of another calibration."""

# --- assembled

ANOTHER_LIST = 14.0
"""Standard deviations between two measurements of a point, ten of their difference: half of them no errors reach."""

# --- horizon

LEAST_CHANGE_PX = 1e-6
"""A change of image points below this is not told: rounding of geocentric coordinates."""

# --- ground

SAME_PLACE_SIGMAS = 3.0
"""Two control points nearer than this many sigmas are pointed out."""

# --- block

MOST_UNDULATION_M = 120.0
"""No geoid undulation of the earth is larger."""

# --- source

MOST_RAD = 4 * np.pi
"""Larger angles are no radians."""

# --- reader

LARGEST_RATIO = 2.0
"""Stated scale over that of known points; tilt and relief change it by less, a wrong factor by more."""

# --- lens conversion

MISFIT_PX = 0.05
"""Largest misfit of a fitted distortion that is taken without being allowed."""

OPENINGS = (0.1, 100.0)
"""Focal length by the longer side of the image, 157 degrees across to half a degree: beyond, one has another unit."""

# --- files

ROUNDING_MM = 6e-4
"""Cameras of photos are printed with three decimals, the default camera with four."""

# --- edited

SAME_PRINTED = 1e-9
"""Relative: values that were printed and read again."""

# --- rows

SAME_CONVERTED = 1e-12
"""Relative: figures that were converted, printed and read again."""

# --- lists

NEAR_M, NEAR_DEG = 0.01, 1e-7
"""Points nearer to each other than this, and not equal, are told: one point with a mistyped digit?"""

# --- joined

SAME_M = 1e-4
"""Coordinates that differ by less are those of one place: the last digit that lists are printed with."""

# --- reader

MATRIX_DIGIT = 2e-6
"""Largest difference of matrices that are printed with six decimals, each rounded by half of the last."""

# --- variants

SAME_PX = 1e-3
"""Image coordinates that differ by less are one measurement: the last digit that lists are printed with."""
