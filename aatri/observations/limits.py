"""Thresholds of observations, each once, with its source."""

# --- reduced

NOTED_NEGLECT = 0.1
"""Share of the standard deviation from which on there is a note of what is neglected."""

# --- poses

NO_TURN_RAD = 3e-5
"""A turn t moves nothing by more than t^2 / 2 of its distance beside the tangent: by 5e-10 of the block's extent."""

GOES_WITH = 0.5
"""Points go with a common turn of the images if their own differs from it by less than this share of it."""

# --- shapes

MOST_TILT = 1.0
"""Standard deviation of a tilt (tangent) beyond which its points do not hold a shape: those of a line no plane."""

# --- rolling shutter

ALONG_STRIP = 0.7
"""Cosine of the angle between steps that are one strip's."""
