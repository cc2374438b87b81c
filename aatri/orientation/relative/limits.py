"""Thresholds of relative orientation, each once, with its source."""

# --- connected

FEWEST_CONNECTION_POINTS = 3
"""Connection points of a connection that can be checked."""

# --- critical

LINE_SIGMAS = 3.0
"""Points lie on a line if they are no farther from it than this many standard deviations, root mean square."""

NO_BASE = 2.0
"""There is no base if a rotation alone fits within this many standard deviations, in the median."""

WEAK_RAD = 0.01
"""A direction or rotation less certain than this is reported: the geometry is near a singular one."""

OPEN_RAD = 0.3
"""A direction or rotation less certain than this is not determined."""

MANY_REJECTED = 0.2
"""Share of rejected points of a pair above which it is reported."""

FAR_BASES, SHORT_BASES = 50.0, 25.0
"""Bases to the points beyond which the base is tiny, and short."""

IN_A_CORNER = 0.25
"""Largest extent, in bases, of points in one small part of the model."""

ON_A_LINE = 0.02
"""Extent across over extent along of points near a line."""

ON_A_CIRCLE = 0.05
"""Largest RMS deviation from the circle, as a share of the points' extent across the base."""

FLAT_DEPTH = 0.02
"""Points whose depth varies by a smaller share of their width lie on a plane, not on a cylinder."""

CIRCLE_BETTER = 0.5
"""Largest RMS deviation from the circle over that from a straight line: rough ground is no cylinder."""

# --- essential

TURNED_SHARE = 0.5
"""Share of the points of a pair that a rotation alone has to explain."""

# --- from consensus

AS_GOOD = 3.0
"""A second orientation explains n points as well if its cost, sum log(1 + (v / 3)^2), exceeds the first one's by no
more than this many standard deviations: the two see other components of the errors, so that the difference of their
sums of squares has a standard deviation of up to 2 sqrt(n), that of the costs a ninth of it."""

AS_GOOD_OF_FEW = 2.0
"""The same where points are few."""

# --- image scale

NEEDS_SMALLER = 1 / 4
"""Share of the standard deviations stated: models that only smaller ones make count where those that fit are below
it. Where they are above it smaller ones have made a base of the errors alone."""

MULTIPLES = (4.0, NEEDS_SMALLER, 16.0, 1 / 16, 64.0, 1 / 64, 256.0)
"""Of the standard deviations stated, tried where these make few models. Powers of four, the nearer ones first: one is
within twice of what fits for all that are up to 100 times too small or too large (`test_far_off_sigmas`)."""

SAMPLED_PAIRS = 500
"""Pairs by which a multiple is chosen: a share of models is then known to 0.02, one standard deviation."""

# --- loops

ENOUGH_FIT = 0.6
"""Share of the points that fit and lie in front of both images in a solution that needs no other start."""

LEAST_SHARE_OF_MODEL = 0.3
"""A smaller share of points that fit makes no model."""

BEHIND_SHARE = 0.1
"""A larger share of points that fit, but behind an image, tells of the other orientation of points in a plane."""

# --- orientations

NEARER = 0.5
"""Of two orientations over a plane the one that is nearer to the expected rotation counts, if it is off by less than
this share of what the other is; else nothing decides. The two differ by many degrees, expected rotations err by few."""

# --- shared planes

OTHER_PLANE_RAD = 0.5
"""Angle between the normals of a plane by two pairs beyond which it tells no more: of other planes, or wrong."""
