"""Thresholds of geometry, each once, with its source."""

# --- portable frame

FLAT_BODY = 1e-4
"""Smallest pivot, of the largest, with which distances hold a body: in a plane none sees what leaves it."""

SOLID_SIGMAS = 10.0
"""Standard deviations by which a mark lies off the plane of all where distances hold the body: their derivatives, and
with these the weights across the plane, are wrong by a share of 1 / SOLID at most."""

# --- similarity

COLLAPSED_SCALE = 1e-6
"""Scale, of that at the start, of points that fit no similarity: no start by two of them is as far off."""
