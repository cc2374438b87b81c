"""Thresholds of problems with ties, each once, with its source."""

# --- added variance

BORDER_TIES, STEEPEST_BEND = 3, 0.5
"""So many nearest ties below the limit say by their median how a bend begins, as a share of the limit: ties beside some
that are wrong together have tests of right ones, whose median is 0.9 to 1.5 and the limit 4 to 6."""

# --- uncertain intersection

UNCERTAIN_DISTANCE = 0.1
"""Share of its distance by which a point of nearly parallel rays is uncertain: its rays tell nothing of each other."""
