"""From where on something is open, once for all who ask; pivots are judged by `kernels.eliminate.RANK_TOLERANCE`.

Ratios are dimensionless; what an unknown may be uncertain by in its own unit says `Unknowns.implausible`.
"""

OPEN = 1e12
"""Q_ii N_ii from which on an unknown is open: no digit that the observations give is left of it."""

WARNED = 0.1
"""Share of the limits of openness from which on there is a warning."""

ALONE = 0.98
"""Share of an open direction within one vertex (the unknowns of an image, point, camera) from which on it is its
own."""

MOVES = 1e-4
"""Share of the largest, squared, from which on a vertex takes part in an open direction."""

UNSEEN = 1e-10
"""Square of what observations see of a motion, as a share of what their parts move by, below which it is open."""

MOTION_IF_OPEN, MOTION_IF_NEARLY, MOTION_IF_WEAK = 1.0 - 1e-6, 0.99, 0.95
"""Cosine from which on a motion of the whole counts as one of the directions: of vanishing pivots, of directions that
are open by rounding, and where a block is bent as well as moved."""

NAMED = 0.2
"""Size of an unknown in an open direction, as a share of the largest, from which on it is named in it, or goes along
with a motion."""

MOST_NAMED = 7
"""Open directions that are named at most: as many as a datum has."""

BEYOND, WITHIN = 1e10, 1e9
"""Ratios of weights beyond the reach of double precision, and to which they are brought; at 1e12 the rank tolerance is
met."""

UNLIKELY = 1e-4
"""Square of a random direction along another, as a share of its mean: less comes once in 1e15 times."""

# --- motions

INDEPENDENT = 1e-3
"""Singular value above which a motion of the whole is an open direction of its own."""

SMALL_PART = 1e-6
"""Size of an unknown in an open direction, of the largest, below which it takes no part in it."""

WHOLE_SHARE = 0.999
"""Share of the squares of an open motion from which on the whole block moves, not a part of it."""

NAMED_PART = 0.02
"""Share below which a generator (shift, rotation, scale) of an open motion is not named."""

# --- nearly open

SAME_DIRECTION = 0.5
"""Cosine from which on two nearly open directions are one."""

# --- set aside

MOST_PARTS = 20
"""Loose parts of a block that are set aside at most, one after the other."""
