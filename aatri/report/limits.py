"""Thresholds of what a report says, each once, with its source."""

# --- facts

DOWNWARDS = -0.9
"""Vertical component of a viewing direction from which on it is called vertical: 26 degrees."""

PARALLEL_STRIPS = 0.9
"""Cosine between strips that are flown beside each other."""

LEAST_SIDEWAYS = 0.1
"""Distance of two strips, as a share of the footprint: nearer strips follow each other, or are flown twice."""

# --- judgement

ALONG_AXIS = 0.9
"""Share of an error that lies along an axis, from which on it is said to be in it: within 26 degrees."""

# --- verdict

CONVERGED = 1e-3
"""Newton decrement at which an adjustment has converged."""
