"""Thresholds of approximate coordinates of networks, each once, with its source."""

# --- meeting

SAME_PLACE = 0.02
"""Candidates for the place of a point nearer to each other than this share of the distances are one."""

CLEARLY_BETTER, LEAST_MISFIT = 20.0, 1e-6
"""The place of a point is sure where a candidate fits so many times better than any other; sums of misfits below the
second are equal."""

MOST_LOCI = 12
"""Of so many a place is sure; rays and circles of distances come before those of angles."""
