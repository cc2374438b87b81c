"""Thresholds of strips, each once, with its source."""

# --- overlap order

FEWEST_OF_NEIGHBOURS = 5
"""Common points of two images that may be neighbours in a strip."""

OPPOSITE_COSINE = -0.5
"""Cosine of the angle between the directions to the two neighbours of an image in its strip, at most."""

NEIGHBOUR_SHARE = 0.5
"""Common points of a neighbour in a strip, as a share of the median of those accepted before, at least."""

MOST_NEIGHBOUR_CANDIDATES = 8
"""Pairs of an image that are looked at for neighbours: those with most common points."""
