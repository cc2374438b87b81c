"""Thresholds of observations, each once, with its source."""

# --- reduced

NOTED_NEGLECT = 0.1
"""Share of the standard deviation of a reduced observation from which on there is a note of what is neglected."""

# --- poses

NO_TURN_RAD = 3e-5
"""A turn t moves nothing by more than t^2 / 2 of its distance beside the tangent: by 5e-10 of the block's extent."""

GOES_WITH = 0.5
"""Points go with a common turn of the images if their own turn differs from it by less than this share of it."""

# --- shapes

MOST_TILT = 1.0
"""Standard deviation of the tilt (tangent) of a plane or line of relative control beyond which its points do not hold
it: those of a line no plane."""

# --- rolling shutter

ALONG_STRIP = 0.7
"""Cosine of the angle between two steps from image to image from which on they are of one strip."""
