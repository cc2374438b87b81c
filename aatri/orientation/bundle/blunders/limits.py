"""Thresholds of the search for single gross errors and of fitted standard deviations, each once, with its source."""

# --- attribution in kind

SOFT_IN_TRIAL = 0.02
"""Standard deviation that exact coordinates get for a trial without one of them, over that of its prediction."""

# --- exact coordinates

SOFT_COORDINATE = 0.3
"""Standard deviation of exact coordinates when they are tested, over the median of new points: adds a twentieth and
less to that of a test."""

WORST_LEFT_OUT = 4
"""Exact coordinates with the largest tests, of which each is left out: tests of a block that is far off tell only
roughly which coordinate bends it, an adjustment without it does."""

# --- fitted sigmas

FAR_TOO_EXACT = 50.0
"""Scale of a small kind beside what a robust adjustment finds wrong, from which it is wrong itself."""

HARMLESS = 2.0
"""Tests up to this many limits smear so little that no robust adjustment is needed."""

ALONE_BEYOND = 2.0
"""Scale of most observations, or one over it, beyond which that of no other kind is estimated beside it: at 2 the
residuals of others have twice the variance they should have, or half."""

MOST_NOISY = 3
"""Images, and no more than a tenth of all: what more of them have is an error of something else."""

# --- noisy images

SUSPICIOUS = 1.5
"""Errors of an image over those of its class that are worth a trial: what least squares leave of them is less; the
scale in the end decides."""

APART = 10.0
"""Factor of the standard deviations of a noisy image on trial: so large that the others no longer follow the image;
what it is in the end its residuals tell."""

MOST_OF_STRIP, MOST_OF_BLOCK = 2 / 3, 0.5
"""Of the images of a strip, so many are suspicious where it is the strip that errs; of the images of a block that are
more, it is the others that are better than usual."""

LEAST_REDUNDANCY_OF_IMAGE = 5.0
"""Of an image, for a suspicion. Apart it has that of a resection, and counts if this is enough to tell a scale."""

NOISY = 1.6 / 0.6
"""Images of one flight are of unlike quality; errors of 0.6 to 1.6 times the usual ones are no fault of any
(`python -m tests.campaigns.false_alarms`), and an image that errs by less than the worst of them beside the best is
weighted like others."""

NOISY_STRIP = 1.6
"""The worst of an ordinary flight by itself, as above: most images of a strip together are not all the worst of it."""

MISNAMED = 50.0
"""Errors of an image, in those of its class, from which on its points have other points' numbers, or the image
another's: half a millimetre where 10 um are usual."""

# --- points

FIRM = 1e-3
"""Standard deviation of an exact coordinate in the test of its point, over that which the rays give it."""

# --- rejections

DOUBT = 6.0
"""|w| up to which records that nothing tells apart stay, and are named: the harm is small, and one of them, of a
control point perhaps, is as good as the others. Beside long tails as much more as these add to the limit."""

# --- renumbered rays

FITS_NUMBER = 2.0
"""Factor of the limit of a ray for another point to be its own: where that is expected is known worse than a coordinate
is measured, from its own rays, often two."""

NEAR_NUMBER = 0.01
"""Share of the principal distance within which another point is looked at for a ray: lens and film are left out at
first."""

# --- robust start

ASTRAY = 20.0
"""Tests of least squares beyond so many limits: what is so far off may turn an image against its other rays, by Huber's
loss too. Chosen by blocks of 15 to 30 images with one number given twice (5 of 38 lost right observations)."""

# --- scaling

MOST_TOGETHER = 150
"""Components of a kind up to which its residuals are looked at together: with more it has redundancy enough."""

NO_ERRORS, FINEST_RAD = 0.02, 1e-6
"""Residuals so much smaller than the standard deviations are no measurements': an example made without errors. Those of
rays must also be smaller than anybody measures directions: 0.15 um at 150 mm."""

# --- search notes

REJECTED_SHARE, REJECTED_LEAST = 0.3, 5
"""An image is named itself where so many of its image points are rejected; a point where half of its rays are."""

# --- swaps

MOST_IN_AN_IMAGE = 200
"""Rejected image points of an image up to which pairs are tried: with more the image itself is wrong."""

# --- tested block

MUCH_LESS = 0.5
"""Share of the squares of what is above the limit that an explanation may leave: one that leaves more is not what is
wrong."""
