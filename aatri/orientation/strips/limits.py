"""Thresholds of strips, each once, with its source."""

# --- overlap order

FEWEST_OF_NEIGHBOURS = 5
"""Common points of neighbours."""

OPPOSITE_COSINE = -0.5
"""Cosine between the places of the two neighbours of an image, at most."""

NEIGHBOUR_SHARE = 0.5
"""Common points of a neighbour, of the median of those accepted before, at least."""

MOST_NEIGHBOUR_CANDIDATES = 8
"""Pairs of an image that are looked at: those with most common points."""
