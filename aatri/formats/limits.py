"""Thresholds of files, each once, with its source."""

import numpy as np

# --- BlocksExchange: what AspectRatio, Skew and angles mean

MOST_OFF_PX = 5.0
"""Median misfit, px, of measured points up to which a way of reading the block fits."""

CLEARLY_BETTER = 2.0
"""Misfit of any other way of reading the block over that of the one which fits."""

FEWEST_DECIDING = 6
"""Measured points below which they do not decide between ways of reading the block."""

# --- conventions: rotation matrices, ground from image or image from ground

ALONG_FLIGHT = 0.9
"""Mean of cos 4(h - a), of headings h of images and azimuths a of steps, that a flight has: images turned against it by
up to 6 degrees."""

APART_SENSES = 0.1
"""Of that mean, by how much less the other sense of the matrices must have, to be told from it: 4 degrees of
azimuth."""

FEWEST_NEIGHBOURS = 3
"""Pairs of neighbouring images below which they do not decide the sense of the matrices."""

LONG_STEP = 2.0
"""A step between images longer than so many times the median leads to another line."""

NOT_ORTHOGONAL = 1e-3
"""What R R' of a rotation matrix may differ from the identity by: matrices are written with six decimals or more, some
with four."""

# --- DBAT: cameras of PhotoModeler

LARGEST_ASPECT_PX = 0.1
"""Pixels of a camera that are not square by more than this, at the edge of the format, are warned of where they count
as square."""

# --- merging: datums of two blocks

FEWEST_SHIFTED = 3
"""Points in common whose shift between two blocks is no chance."""

SAME_SHIFT = 0.01
"""Share of a shift by which the datums of two blocks may differ from point to point: they are turned and scaled,
too."""

# --- GIS: footprints

STEEPEST = 0.1
"""Least cosine between a ray of a footprint and the vertical: flatter ones end at the horizon."""

# --- Inpho

SAME_FOCAL_MM = 1e-3
"""A focal length beside an orientation that differs from that of its camera by more is of another calibration."""

# --- image points of several sources

ANOTHER_LIST = 14.0
"""Standard deviations between two measurements of an image point, ten of their difference, from which two sources are
different measurements: half of them no errors reach."""

# --- exports: points seen from curved ground

LEAST_CHANGE_PX = 1e-6
"""A change of image points by an export below this is not told: rounding of geocentric coordinates."""

# --- native tables: ground_points.csv

SAME_PLACE_SIGMAS = 3.0
"""Two control points nearer to each other than this many sigmas are pointed out."""

# --- native tables: block.yaml

MOST_UNDULATION_M = 120.0
"""No geoid undulation of the earth is larger."""

# --- native tables: angles

MOST_RAD = 4 * np.pi
"""Angles of a table in radians beyond it are none: two full turns."""

# --- WuCAPS

LARGEST_RATIO = 2.0
"""Scale number stated of a strip over that between its known points: tilt and relief change it by less, a wrong factor
by more."""

# --- conventions: conversion of lenses

MISFIT_PX = 0.05
"""Largest misfit of a fitted distortion that is taken without being allowed."""

OPENINGS = (0.1, 100.0)
"""Focal length by the longer side of the image, 157 degrees across to half a degree: beyond, one has another unit."""

# --- DBAT: exports of PhotoModeler

ROUNDING_MM = 6e-4
"""Difference between the camera of a photo, printed with three decimals, and the default camera, with four."""

# --- edits.yaml

SAME_PRINTED = 1e-9
"""Relative difference of the value that an edit names and the one in the block: values printed and read again."""

# --- merging: rows of two blocks

SAME_CONVERTED = 1e-12
"""Relative difference of a row that two merged blocks both have: figures that were converted, printed and read
again."""

# --- OpenSfM: gcp_list.txt

NEAR_M, NEAR_DEG = 0.01, 1e-7
"""Control points nearer to each other than this, and not equal, are told: one point with a mistyped digit?"""

# --- sources of one block: the same row twice

SAME_M = 1e-4
"""Coordinates of one point or image in two sources that differ by less are the same: the last digit that lists are
printed with."""

# --- Pix4D

MATRIX_DIGIT = 2e-6
"""Largest difference of projection matrices that are printed with six decimals, each rounded by half of the last."""

# --- variants of one block in a folder

SAME_PX = 1e-3
"""Image coordinates of one point in two files that differ by less are one measurement: the last digit that lists are
printed with."""
