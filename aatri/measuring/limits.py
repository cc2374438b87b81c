"""Thresholds of measuring by hand, each once, with its source."""

ALIKE_HALVES = 0.8
"""Smallest correlation of the two halves of a mark that is clicked, that of `fiducial_marks/template` with its
template."""

ONE_DIRECTION = 0.02
"""Share of the trace of the normal matrix of a matched window below which its smaller eigenvalue belongs to an edge;
0.5 of a dot."""
