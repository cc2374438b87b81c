"""Thresholds of geometry, each once, with its source."""

# --- determined by points

MIN_POINTS = 3
"""Known points that determine the orientation of an image."""

MIN_CONTROL = 3
"""Control points, or observed positions, that could be the datum of a block: those of a similarity."""

# --- known rotations

UNKNOWN_PLACE = 0.1
"""Standard deviation, as a share of the length of rays, beyond which a place is not determined: an adjustment that
begins with such errors converges (docs/convergence.md)."""

FARTHEST_RAD, FAR_OFF_RAYS = 0.005, 6.0
"""Median misfit beyond which the directions are wrong: a boresight that nobody has measured stays below. Standard
deviations, of which others are as many off, beyond which a single ray is."""

MOST_CENTRES, MOST_POINTS = 300, 20_000
"""Projection centres and points that are placed together, of more none: with 6,000 points of five rays each so many
take 0.6 s a pass (one core), with 20,000 points 1.5 s."""

# --- portable frame

FLAT_BODY = 1e-4
"""Smallest pivot, of the largest, with which distances hold a body: in a plane none sees what leaves it."""

SOLID_SIGMAS = 10.0
"""Standard deviations by which a mark lies off the plane of all where distances hold the body: their derivatives, and
with these the weights across the plane, are wrong by a share of 1 / SOLID at most."""

# --- similarity

COLLAPSED_SCALE = 1e-6
"""Scale, of that at the start, of points that fit no similarity: no start by two of them is as far off."""
