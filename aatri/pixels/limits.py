"""Thresholds of what is measured in pixels, each once, with its source."""

FAINTEST, LARGEST_CHANGE = 1e-3, 0.5
"""Of least squares matching: contrast of the window by that of the template, of its whole range, below which, and
change of the affine transformation beyond which, nothing matches."""

NEXT_RATIO = 0.8
"""Distance of the description of a feature to the nearest in the other image by that to the next, below which the two
are a match (Lowe 2004)."""

COARSE_MATCHES = 12
"""Matches of the largest features that make two images a pair; by chance 5 were met."""

FEWEST_MARKS = 3
"""Fiducial marks that determine a transformation with redundancy."""

ALIKE_MM = 0.01
"""Difference of the residuals of fiducial marks that says nothing of which way the film lay."""
