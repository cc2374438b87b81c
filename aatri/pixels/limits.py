"""Thresholds of what is measured in pixels, each once, with its source."""

FAINTEST, LARGEST_CHANGE = 1e-3, 0.5
"""Contrast of the window by that of the template, of its whole range, and change of A, beyond which nothing matches."""

NEXT_RATIO = 0.8
"""Distance to the nearest description by that to the next, below which it is a match (Lowe 2004)."""

COARSE_MATCHES = 12
"""Matches of them that make two images a pair; by chance 5 were met."""

FEWEST_MARKS = 3
"""Marks of a transformation with redundancy."""

ALIKE_MM = 0.01
"""Difference of residuals that says nothing of which way the film lay."""
