"""Thresholds of the orientation image by image, each once, with its source."""

# --- component

WIDE_RAD = 0.03
"""Rays of a component farther off their points than this before the bundle are left out of it."""

NARROW_RAD = 0.005
"""The same where with those up to `WIDE_RAD` it does not converge: a mirrored image of a wall is some degrees off."""

FEWEST_POINTS = 6
"""Images of which fewer points fit a component are not oriented."""

LEAST_SHOWN = 0.1
"""Share of the errors that residuals of a component show at least: with fewer, what is left out says more of them."""

LEAST_FITTING = 0.4
"""Images of which a smaller share of the points fits in the end are not oriented."""

LEAST_SPREAD = 0.1
"""Least spread of the residuals of a component, in stated standard deviations: more than ten times too large ones count
no more, for residuals of made-up points may be zero."""

# --- component bodies

FREE_DISTANCE_SHARE = 0.1
"""Standard deviation of a principal distance of which nothing is said, as a share of it."""

DATUM_SHARE = 0.1
"""Standard deviation of approximate coordinates as a share of the extent of the ground points: errors of it turn a
block by 0.1 rad, from which each trial of docs/convergence.md converges; what is observed more exactly outweighs them.
"""

# --- few points

FEWEST_COMMON, MOST_COMMON = 2, 12
"""Common points that give a scale, and those of which each is left out once: of more one wrong turns no start."""

WEAKEST_COMBINATION = 0.02
"""Least effect of a combination of the seven unknowns on the rays that fit, as a share of the largest: its error is at
most fifty times that of the best known one."""

# --- free images

WRONG_ROTATION_RAD = 0.05
"""A pair whose rotation is off by more than this, or `WRONG_SIGMAS` times its own standard deviation, is wrong."""

OPEN_TRIANGLES = 0.1
"""Trust in a rotation of a pair that is in no triangle; of others it is the share of triangles that close, at least the
square of this."""

# --- ground tests

CONTRADICTED = 0.02
"""Deformation of a component, as a share of the distance of the images, beyond which scarce observations, or points
shared with neighbours, contradict each other: a principal distance a fifth off deforms so much over ground that rises
by a tenth of the distance."""

DEFORMED = 5.0
"""Times the standard deviation of its points that a component may be deformed by without a warning."""

# --- joining

FEWEST_TO_JOIN = 5
"""Points in common that must fit, for components to be joined."""

FITTING_SHARE = 0.02
"""Distance within which common points of two components fit, as a share of their extent."""

MOST_WRONG = 0.4
"""Share of the common points of two components that may be wrong."""

ON_A_LINE = 0.02
"""Common points of two components lie on a line if they spread less across it, as a share of its length."""

FEWEST_DISTANCES, SAME_SCALE = 2, 0.05
"""Common points that must agree on the scale of components that share an image, to this share of it."""

# --- neighbouring components

FEWEST_OTHERS, MOST_SHARED = 4, 30
"""Points shared with neighbours that must fit each other for another to be the wrong one (three fit alone by two
conditions); of more points than the second one wrong does not spoil the start."""

# --- rotations

CLOSED_RAD = 0.02
"""A triangle of rotations closes within this, or within `OFF_SIGMAS` standard deviations where these are larger."""

# --- scales

PAIRS_PER_IMAGE = 8
"""Pairs of each image that carry scale: the strongest ones, and a tree of all."""

FEWEST_FOR_SCALE = 3
"""Two pairs with fewer points in common do not tell the ratio of their bases; three stand at the standard positions."""

SPREAD_OF_SCALES = 0.5
"""Median deviation of the logarithm, from point to point, of the ratio of the bases of two pairs: ratios with more are
not used."""

# --- to ground

OPEN_MOTION = 1e-8
"""Lambda of a motion (`bodies.limits.UNDETERMINED_MOTION`) below which it is held where the datum is free."""

# --- triangulation

TRIM_LIMIT = 5.0
"""Rays are trimmed beyond so many standard deviations, or so many times the spread where that is larger: of normal
errors one in 270,000, exp(-LIMIT^2 / 2) of lengths of two components; the bundle tests it again."""

LEAST_PARALLAX_RAD = 0.005
"""Points whose rays all lie within a smaller angle are not determined."""

# --- starting distance

FITTING_ROTATIONS_RAD = 0.005
"""Rotations of pairs that fit within 0.3 degrees, a quarter of `CLOSED_RAD`, call for no other principal distance."""

LEFT_BY_DISTANCE = 0.7
"""Share of the misfit that another principal distance may leave to be taken: of 40 made-up blocks around and within
objects, lenses unknown, the right one left 0.02 to 0.6."""

FEWEST_IN_TRIANGLES = 6
"""Pairs in triangles that tell of a principal distance: those of four images."""

LOOSE_DISTANCE = 0.03
"""Standard deviation of a principal distance, as a share of it, from which on another one is looked for: a bundle ends
right from 30 % off (docs/convergence.md), the loops of an orbit fall apart at 5 %."""
