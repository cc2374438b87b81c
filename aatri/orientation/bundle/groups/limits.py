"""Thresholds of the search for groups that are wrong together, each once, with its source."""

# --- candidates

ENOUGH_UNITS = 10
"""Units (images, flights, cameras) from which on most are right, and tell what units have in common without being
wrong."""

MOST_TYPICAL = 24
"""Images that tell what images and their neighbourhoods have in common where nothing is wrong with them."""

# --- failed search

SCATTERED = 30.0
"""Starts of strips and graphs miss by some sigmas of the image points; a wrong number by hundreds and more."""

MOST_SCATTERED = 0.01
"""Share of the points, but one in any case: where more are scattered, the start is wrong."""

MOST_IMAGES_TRIED, MOST_RAYS_TRIED = 12, 50_000
"""Images that are left out on trial, one by one, of blocks of so many rays at most: beyond, it takes minutes."""

# --- frame marks

HARDLY_SEEN = 1e-3
"""Singular value, as a share of the largest, of a direction in which distances hardly see a mark: it stays there."""

# --- neighbourhoods

MOST_OF_AN_IMAGE = 0.7
"""A larger share of the points of an image is no neighbourhood: the image itself is wrong."""

MOST_OF_A_NEIGHBOURHOOD = 0.6
"""Share of its points that another image must show to be tried instead."""

LARGE_RESIDUAL, FEWEST_LARGE = 2.5, 3
"""Images with so many residuals beyond so many standard deviations are looked at."""

LEAST_LEFT = 0.1
"""Share of the shift of a neighbourhood that a linear field over the image leaves at least: of a shift of 0.7 of the
points it takes up 0.9."""

MOST_IMAGES_TESTED = 12
"""Images that are tested by themselves, those with the largest bounds."""

# --- score tests

MOST_CANDIDATE_GROUPS, EXPLAINS = 4, 0.1
"""Groups that are returned, and the share that each explains at least of what the best does: one step from a model that
is far off tells them apart only so far, an adjustment with each of them does."""

# --- search

MOST_GROUPS = 6
"""Groups that are looked for, one by one; where more is wrong, the model of the block is."""

SEVERAL = 3
"""Rejections of a kind from which on they may be a group: two are single ones."""

ROUGH_SQUARES = 25.0
"""By how much v'v of the adjustments on the way may differ from its least: they end with a decrement of 5."""
