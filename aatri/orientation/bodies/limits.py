"""Thresholds of bodies on the ground: what ties, what determines, what fits, what is wrong; each once."""

import numpy as np

# --- components

GROSS_TIE = 30.0
"""Common points further from the median over their strips than this, in medians of all such distances, start as
rejected."""

MOST_TURNED_OVER = 5
"""Strips that are left to themselves at most because others do not converge with them; beyond that all is wrong."""

TIE_LIMIT = 6.0
"""Test statistic of a wrong tie between strips. Strips are deformed smoothly, so that good ties reach larger values
than noise."""

# --- component growth

WEAKEST_TIE_RAD = 0.05
"""A tie between components whose weakest rotation is known worse than this joins nothing."""

LONGEST_LEVER = 20.0
"""How many times the errors of common points may grow at the edge of the smaller component."""

# --- model ties

FEWEST_COMMON_OF_MODELS = 3
"""Common points from which on two models make one."""

# --- taken up

WEAK_TIE = 1e-7
"""Eigenvalue, of a normal matrix of unit diagonal, below which common points do not tie: such strips were not joined,
and went to the ground on their own."""

# --- absolute orientation

ONE_MISFIT_IN = 4
"""One strip of so many may fit neither control nor the others, and one of fewer; more have another cause."""

MOST_CANDIDATE_STRIPS = 3
"""Strips that are tried for a misfit, as a bent strip bends those it is joined to."""

# --- datum start

COLLINEAR_PLACES, THINNEST_PLACES = 0.01, 1e-8
"""Places known in full count as lying on a line if the ratio of the eigenvalues of their scatter is below the first.
Down to the second, where rounding begins to decide the turn about that line, they are one start among others."""

ALL_SIDES = 0.3
"""Length of the mean viewing direction below which images look to all sides, and none of them is upwards."""

UPWARDS = 0.7
"""Sine of the elevation above which images look upwards: such an end counts only where there is no other."""

# --- wrong control

EXCHANGE_LEAVES, SECOND_LEAVES = 0.1, 2.0
"""Share of the sum of distances at control that an exchange of two points leaves at most; so many times as much any
other exchange leaves."""

FEWEST_FOR_EXCHANGE = 5
"""Control points below which two exchanged ones cannot be told: three must be left."""

MOST_BY_ALL, MOST_SEARCHED, SPARE_FOR_EXCHANGE = 12, 4, 4
"""Control points of which each two are tried by all observations, and where all headings are tried for each two; the
least redundancy, as two of three points alone would be exchanged by chance."""

CLEARLY_UPWARDS = 0.17
"""Sine of the elevation, 10 degrees, above which images look upwards in the mean where the control says so too."""

TRIANGLE, FEWEST_MIRRORED, MIRRORED_CLEARLY = 3, 5, 0.2
"""Control points that always fit mirrored; fewer full points than the second do not say whether mirrored ones fit
better, by a misfit of less than this share."""

FLAT_CONTROL = 1e-3
"""Misfit, as a share of the extent, of points that fit, or lie in a plane and fit either way."""

# --- agreeing places

FEWEST_AGREEING = 5
"""Places that agree: any three fit, and of four one more that lies near them."""

OFF_BEYOND = 4.0
"""Misfit of a place by the similarity of the others, in those up to which places agree: what is off by more is no
deformation, and what is off by less is none of the wrong ones meant here."""

# --- control by rays

CLEARLY_LIKELIER = 2 * np.log(100.0)
"""Difference of two sums of squares of residuals that makes the better one a hundred times as likely."""

# --- datum analysis

UNDETERMINED_MOTION = 0.04
"""Lambda of a motion below which it is not determined: errors of control are magnified five times."""

NAMED_SHARE = 0.3
"""Share of a parameter of the datum that must lie in what is not determined for it to be named."""

# --- ground observed

HARDLY_DETERMINED = 1e-4
"""Motions with a lambda above this (errors of control magnified less than 100 times) may start a bundle, which tells
how well they are known, where nothing better is there; see `datum_analysis`."""

# --- absolute datum

EXTRAPOLATION_WARNED = 3.0
"""Times that errors of control are magnified, beyond which this is a warning."""

# --- joint start

UNKNOWN_MOTION = 0.1
"""Standard deviation of a motion of bodies, as a share of their extent, beyond which it is not determined."""

MOVED_SHARE = 0.1
"""Share of an open motion of several bodies above which it moves a body."""

# --- absolute

STIFF_SIGMA0, STIFF_REDUNDANCY = 2.0, 4
"""Largest sigma0 and least redundancy without what was rejected, for gross errors to be told from deformation."""

ONE_FAR_IN = 4
"""One in so many may be far from the start for gross errors to bend the body: of eight, over two are wrong in 4 %, if
one in ten is (Hampel et al. 1986, Robust Statistics, 1.2c). Where c is 2 % off half are far, and the others fit any."""

# --- deformation

MISFIT_OF_RIGHT = 0.005
"""Misfit, as a share of the distance between images and points, that nothing of right ids, units and axes has: a tenth
of what the bundle can begin from (docs/convergence.md)."""

FARTHEST_START = 10 * MISFIT_OF_RIGHT
"""Misfit from which the bundle begins: a principal distance a tenth off leaves 4 to 5 %, and from 0.7 to 1.3 times it
the bundle ends right (docs/convergence.md, the bent valley). Of other causes as large its own tests tell."""

FIFTH_OF_FOUR, FAR_LESS = 0.2**4, 0.5
"""Of the r-th power of a share of a deformation, and of the share itself, below which what was left out bent the body:
a fifth of four residuals, and of many no more than a half. The fourth part of normal residuals that is farthest off
leaves 0.61 of their RMS to the others, by itself: (1 - 2 z phi(z) / 0.75)^0.5 with z = 1.15, beyond which that is."""

# --- height factor

FLAT_RELIEF = 1e-5
"""Heights that differ by less than this share of the extent, a centimetre a kilometre, are of no other unit: a flat
model has a relief of its own errors alone."""

SPARE_HEIGHTS = 2
"""Heights beyond the four that the factor takes."""

FACTOR_LEAVES = 0.3
"""Share of the residuals of heights that a factor of heights may leave."""

FACTOR_SIGMA = 0.07
"""A factor is told if it is known to this share of itself, and if 1 is ten standard deviations away."""

NEAR_FACTOR = 0.1
"""A factor so near to a known one, as a share of it, is that: a lens that bends the model takes it a little away."""

NO_LENS_FACTOR = 2.0
"""A factor, or its inverse, beyond this is no matter of a calibration."""

# --- ground fit

VERTICAL_COSINE = np.cos(np.radians(10.0))
"""Cosine of the largest tilt of images at which a stretch along their axes is one of the heights: at t it is short by
1 - cos t (1.5 %), and shifts plan by sin t of it (17 %)."""

# --- models on ground

START_LIMIT = 5.0
"""Test statistic of wrong control where a component is laid onto it, in sigma: as in the absolute orientation."""

# --- determined degrees

WORST_EXTRAPOLATION = 2.0
"""Precision of the corrections of a strip, RMS, over that of a single point of it, beyond which its degree falls."""
