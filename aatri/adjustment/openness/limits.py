"""From where on something is open, once for all who ask; pivots are judged by `kernels.eliminate.RANK_TOLERANCE`.

Ratios are dimensionless; what an unknown may be uncertain by in its own unit says `Unknowns.implausible`.
"""

OPEN = 1e12
"""Q_ii N_ii from which on an unknown is open: no digit that the observations give is left of it."""

WARNED = 0.1
"""Share of the limits from which on there is a warning."""

ALONE = 0.98
"""Share of a direction within one vertex from which on it is that vertex's own."""

MOVES = 1e-4
"""Share of the largest, squared, from which on a vertex takes part in an open direction."""

UNSEEN = 1e-10
"""Square of what observations see of a motion, as a share of what their parts move by, below which it is open."""

MOTION_IF_OPEN, MOTION_IF_NEARLY, MOTION_IF_WEAK = 1.0 - 1e-6, 0.99, 0.95
"""Cosine from which on a motion of the whole counts as one of the directions: of vanishing pivots, of directions that
are open by rounding, and where a block is bent as well as moved."""

NAMED = 0.2
"""Share of the largest from which on an unknown is named in a direction, or goes along with a motion."""

MOST_NAMED = 7
"""So many directions at most are named: as many as a datum has."""

BEYOND, WITHIN = 1e10, 1e9
"""Ratios of weights beyond the reach of double precision, and to which they are brought; at 1e12 the rank tolerance is
met."""

UNLIKELY = 1e-4
"""Share of its mean below which the square of a random direction along another comes once in 1e15 times."""

# --- motions

INDEPENDENT = 1e-3
"""Singular values above this make a direction of its own."""

SMALL_PART = 1e-6
"""Size, of the largest, below which an unknown takes no part in a direction."""

WHOLE_SHARE = 0.999
"""Share of what could move from which on the whole does."""

NAMED_PART = 0.02
"""Share below which a generator is not named."""

# --- nearly open

SAME_DIRECTION = 0.5
"""Cosine from which on two directions are one."""

# --- set aside

MOST_PARTS = 20
"""So many loose parts are set aside at most, one after the other."""
