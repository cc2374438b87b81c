"""Thresholds of what is said of data and results, each once, with its source or the campaign that chose it.

A threshold that stands for a test is none: the test is made, with its false-alarm rate and the number of tests
(`aatri.adjustment.statistics.limits`).
"""

import math

# --- after: weak datum

WEAK_SHARE = 0.95
"""Quantile of the standard deviations of all points that is held against `WEAK_DATUM`: a few may be weak."""

# --- after: left out

RESECTING, RESECTING_ACROSS = 6, 0.3
"""Known points that orient an image: four do, or five of which three lie on a line; six leave one to check. They spread
across by this share of what they do along: those in the side overlap of another strip, a fifth of the image, do not."""

# --- after: hinge image

TIE_POINTS = 3
"""Common points by which two images are tied: those of a resection."""

OWN_DATUM = 3
"""Control points and positions that determine a part of a block by itself."""

# --- as read: how much is told, and what is set aside

MAX_REJECT_SHARE = 0.05
"""Largest share of the image points that may lie outside the format, and of the positions that cannot be, unless
options say another: more is a wrong unit or origin, not single rows."""

MOST_LISTED, MOST_REJECTS_TOLD = 20, 5
"""Places shown of one error; more rejects of one kind for one reason are told in one line."""

FORMAT_MARGIN = 0.05
"""How far beyond the image format, as a share of it, an image point may lie: marks and margins of scans lie there."""

FEWEST_IMAGE_POINTS = 3
"""Image points that determine an image without an observed position (space resection)."""

SAME_POINT_SIGMAS = 6.0
"""Standard deviations of their difference by which two measurements of a point in an image may differ: by chance it
happens once in 5e8 (two-sided normal), in a block of 1e6 such points once in 500."""

FEWEST_POSITIONS = 4
"""Fewer positions have no middle to be far from."""

FAR_POSITION, LOW_POSITION, LEVEL_FLIGHT, SAME_POSITION_M = 50.0, 0.1, 5.0, 1e-6
"""See `as_read.positions`: the longest corridors of the random legal blocks stay below a tenth of the first; rows 56,
80 and 81 of the bad inputs lie ten times beyond."""

LEAST_SHARED, LEAST_SHARE, LEAST_IMAGES, MOST_AT_ONE_PLACE = 5, 0.5, 2, 20
"""Points two images must share to be one image given twice (as many as orient one to the other), and of the points of
each; images in which two points must coincide to be one; rows of one place that are compared with each other."""

COMPARED_POINTS, FEWEST_ACROSS, NEARER = 200, 3, 0.8
"""Points of an image, on average, by which images are compared in their strips: all where it has no more. Neighbours of
two images of different strips by which they may be exchanged: no image is nearer to both neighbours of another than
the middle between them. Share of the distance to the image beside it at which another is nearer: one exchanged with
the next is at half of it, and places of tilted images are out by a tenth."""

SMALLEST_SIGMA, LARGEST_SIGMA = 1e-15, 1e12
"""Of standard deviations in the units of the Block: in m the size of an atomic nucleus, and beyond Jupiter."""

LEAST_EIGENVALUE = 1e-12
"""Of a matrix of correlations; below, two figures are one to all the digits a solution has."""

# --- as read: cameras

FIELD_OF_VIEW_DEG = (1.0, 150.0)
"""Narrower or wider cameras are rare: 1 degree is 2,500 mm of focal length on a full frame; with a tenth of its
principal distance a film camera comes to 168. Of a fish-eye, r = c theta, the corner of the format counts, not what it
sees: 220 degrees in a circle that the format holds count as up to 148."""

USUAL_FIELD_DEG = (5.0, 140.0)
"""From long lenses (300 mm on a full frame: 8 degrees) to super-wide aerial cameras (88 mm on 23 cm film: 123)."""

SAMPLING_M, SMALLEST_SCALE = (1e-5, 100.0), 2e6
"""Ground sampling distances from the microscope (0.01 mm) to satellites, and the scale number of film from orbit."""

FEWEST_COVERING, SMALL_COVERAGE, NO_COVERAGE, BEYOND_FORMAT = 20, 0.1, 0.05, 2.0
"""Image points of a camera below which they may lie together; shares of the format that they cover below which it is
told, and is an error; times the half diagonal beyond which they are in another unit. Units differ by 25 and more."""

FILLED = 0.7
"""Share of a quarter of the format, along both sides, that the points of whole images reach: a target has less."""

IMPRECISE, USUAL_SIGMA_MM = 0.008, (3e-4, 0.05)
"""Standard deviation of image points as a share of what the points span: half a pixel is 0.006 of a thermal image of
80 x 60 pixels; 2 um of 22 cm of film read as mm are 0.009, 1 um of 10 cm of a digital frame 0.010. Standard deviations
that are usual: from a thirtieth of a pixel of 9 um (targets) to two pixels of film scanned at 25 um."""

MOST_EXACT_PX, MOST_EXACT = 0.02, 1e-6
"""Standard deviations below which no image point is measured, of pixels and of the image: the best
targets have 0.02 to 0.05 px, the best comparators 1 um of 23 cm (Luhmann et al., Close-Range Photogrammetry)."""

LARGEST_AIRCRAFT_M, LONG_LEVER_ARM_M, LEVER_SHARE = 90.0, 10.0, 0.5
"""Nothing that flew was larger (Antonov 225: 84 by 88 m), and no antenna is farther from its camera; a lever arm long
for other carriers, and the share of the distance from the object beyond which it is one in another unit."""

# --- as read: frames

LARGE_BLOCK_M = 10e3
"""Across; larger blocks do not lie in a plane: the earth bends by 2 m over 5 km."""

# --- as read: control against positions (rows 70 to 79 of the bad inputs are named, legal blocks stay silent:
# tests/formats/test_legal_work.py, test_wrong_units_of_real_blocks.py)

FAR_CONTROL, EXPLAINED_DISTANCE, MOST_SEEN_M, LEAST_FAR_M = 5.0, 0.1, 100e3, 1.0
"""Distance of control from positions, in the others', that is far; share of it that a change leaves to explain it; what
no image sees; what is never far, in figures of a small object."""

ZONE_EASTING_M = 1e6
"""A zone number before the easting counts millions."""

LEAST_ANGLE_RAD, FEWEST_ANGLES, MOST_ANGLE_IMAGES, MOST_ANGLE_POINTS = 0.01, 3, 300, 12
"""Angles between rays that say something, how many must be there, and how many images and points of each suffice."""

UNFIT_OBSERVED, UNFIT_APPROXIMATE = 0.05, 0.25
"""Misfit of the angles that is too large: with observed positions, with approximate ones."""

EXPLAINED_ANGLES, FIT_OBSERVED, CERTAINLY_EXPLAINED = 0.3, 0.02, 0.1
"""A change is named that leaves this share of the misfit, with observed positions also no more than the second; one
that leaves the third is certain."""

CERTAIN_MISFIT, NOTHING_FITS = 0.25, 0.5
"""Misfits beyond which a lens or a height that is estimated is certain, and which are an error without a cause."""

# --- at start

HIGHEST_FLIGHT_M = 40_000.0
"""Above the points: the highest that aircraft have flown is 37.7 km (FAI record of 1977), balloons with men 41 km
(2014); photographs from space get this warning too."""

BEHIND, UPWARDS, CONTROL_MARGIN = 0.05, 0.7, 0.1
"""A larger share of points behind their camera is no matter of a few wrong points; an image whose points lie higher by
more than the second share of their distance looks upwards (45 degrees), or the other way than before by this cosine; so
far beyond its edge, as a share of the format, a control point may project: orientations are approximate."""

FEWEST_OF_MOST = 4
"""Control points of which most are outside of their images: of three, two may be exchanged."""

ENOUGH_CONTROL = 3
"""Other control points without which an adjustment cannot leave out two: the datum takes three."""

MIRRORED_BETTER, NOT_MIRRORED = 0.25, 1e-4
"""Share of the squares of residuals that a mirror image leaves of those of a similarity where two images see the ground
from opposite sides: half of the residuals, while heights and tilts of aerial images leave a tenth. Probability that
points of different numbers say so somewhere in a block."""

FAR_OFF, MISFIT, MOST_MISFITS, FEWEST_FITTING, NOT_EXCHANGED = 3.0, 1.3, 12, 6, 1e-4
"""Film images that are off by so many times what images of the better quarter are: beyond the first their neighbours
may be bent too, beyond the second they may have another's marks. As many as the third are tried, the worst: more are no
mistake of two or three rows. Fewer points than the fourth fit too easily (six leave a resection six of their twelve
coordinates). The last is the probability that a pair of a block is named by chance, of images in strips as well."""

OTHER_UNIT = 5.0
"""Times by which scale and precision of a model differ from those of the others where its unit is another: units differ
by ten and more (25.4 of the inch), scales of one flight hardly by two."""

FRAME_EFFECT_TOLD_M, FRAME_EFFECT_WARNED_M = 1e-4, 1e-3
"""Systematic errors of heights by the figure of the earth: below the first not worth a word, beyond the second a
warning, for close range measures to it."""

GEOID_SLOPE = 5e-5
"""Slope of a geoid against the ellipsoid, the deflection of the vertical: some 10 seconds of arc, in mountains more
(Torge, Geodesy). A block whose heights lean by it leans as a whole: what is observed high above ground moves in
plan."""

FEWEST_OF_CONVENTION, BETTER_CONVENTION, CERTAIN_CONVENTION, POOR_CONVENTION_SIGMAS = 4, 5.0, 50.0, 20.0
"""Values of a kind that tell a convention; ratios of the median differences from which on another one is told, and is
certain: starts are good to 2 %; medians below so many standard deviations are no reason to look."""

REVERSED_RAD = math.radians(1.0)
"""By how much an azimuth may differ from the opposite of the start, good to 2 % of distances."""

WRONG_ATTITUDES_RAD, AGREEING_READING, SAME_READING, FEWEST_ATTITUDES = math.radians(1.0), 0.2, 1.2, 3
"""Attitudes that scatter by more (the worst MEMS units are good to 0.5 degrees) are in another convention, if one is
found that scatters by this share of it, and of that of images without any attitudes; readings that agree up to the
factor are one: some are the same rotations by other names, and the simplest is told. Fewer images say nothing of a
convention."""

LARGEST_BORESIGHT_RAD = math.radians(45.0)
"""Beyond it the camera is nearer to another `mount` than to the one declared."""

FEWEST_OF_START, MOST_RAYS_OF_START = 4, 5_000
"""Images and rays, those of whole points, by which the angles of a start are judged: by three images wrong angles may
agree in one of the 80 readings by chance; with as many rays these take half a second."""

WRONG_START_RAD = math.radians(10.0)
"""Misses of rays that no planned flight has: its images are tilted by 5 degrees at most."""

MOST_EXCHANGED = 8
"""Images of which each pair is tried with the orientations exchanged: those whose rays miss by most."""

POOR_START_RAD = math.radians(0.2)
"""Misses of rays below which a start is good: mirrored images of flat ground that overlap by a third miss by 1.6."""

UNLIKELY_SIGMAS = 3.0
"""Standard deviations of an angle, three in 1,000 by chance (normal, two-sided), up to which attitudes and mounts are
poor rather than wrong: nearly all attitudes of a camera with right ones stay below, so that it is never asked."""

SHARES_OF_ATTITUDES = (0.5, 0.9)
"""Of the attitudes that agree or not: half of them, robust, then nearly all; a reading is proposed by either."""

# --- after: models, joints

OUT_OF_SEQUENCE = 1.5
"""An image that shares so many times more points with another than with either neighbour may be out of sequence."""

CHECKED_POINTS, UNSTABLE_SPREAD = 3, 0.2
"""With fewer connection points a wrong one cannot be located; those that cover less of the width of the models make an
unstable bridge."""

# --- after: film, photo coordinates

TOO_SIMPLE, LARGEST_SHEAR, FEWEST_ALIKE = 1.5, 1e-3, 3
"""A similarity whose sigma0 is so many times that of an affine transformation leaves out what the film has done, and
marks whose sigma0 falls so without what their residuals in so many images have in common have wrong coordinates;
affine deformation of film beyond the second is unusual."""

PHOTO_MARGIN, LARGE_PRINCIPAL_POINT = 0.01, 0.05
"""Shares of the format: so far beyond its edge a point still counts as inside; a principal point so far off its centre
may count from another origin."""

SMOOTH_SIGNAL, LARGE_SIGNAL = 0.2, 0.3
"""A signal of residuals is smooth from this share of the plate's radius on, and no small matter from this share of the
noise on: with a lens of k1 = 5e-9 mm^-2 unknown to a block (0.23, 0.56) heights were 1.9 times their standard
deviations off after collocation, with k1 = 2e-9 (0.23, 0.06) 1.04 times, with parameters (0.05, 0.13) 1.07 times."""

# --- after: parameters, correlations

CALIBRATION_CHANGED = 1e-3
"""Probability below which a difference to a calibration is told as a warning."""

MOVED_SIGMAS = 10.0
"""A parameter that moves by more than this times its own standard deviation a priori is another one's: by chance
1e-23."""

MOST_UNITS_TOLD = 4
"""More units than this are summed up in one line."""

CORRELATION_LISTED, MOST_PAIRS = 0.90, 60
"""Correlations told, and pairs of blocks looked at, of which each takes a solve. A warning comes from 0.95 on, where
one of the two has three times the standard deviation it had alone (1 / sqrt(1 - rho^2))."""

# --- as read: images

FEWEST_CELLS = 0.3
"""Share of the cells of an image with a tie point, below which it is named: of canopy and water a side stays empty
while the number of points looks fine (8 x 8 cells)."""

# --- after: groups, standard deviations of kinds, hidden distortion

SIGMAS_LEVEL, SIGMAS_FACTOR, LEAST_KIND_REDUNDANCY = 1e-3, 2.0, 2.0
"""Probability that a block with right standard deviations is told of a wrong kind; factor by which they must be wrong:
less is left to variance components; redundancy below which a kind is not tested, where chance reaches any factor."""

FAR_MORE_EXACT = 100.0
"""Standard deviation of an image point on the ground over that of control or positions, from which these are told.
Surveys of an image block are 1 to 20 times as exact as an image point."""

OTHER_LEVER_ARM = 0.01
"""Probability by which a lever arm that is right in another unit or with other signs is not named as such."""

SHORTEST_ARM_M = 1e-3
"""No lever arm is measured to less: a reading that makes one so short is as good as none."""

SHARPER = 2e4
"""Times that weighted relative control may be sharper than image points on the ground: at 8e3 the result is that of the
exact condition to 1e-7 of a standard deviation, at 8e4 pivots of its points vanish in rounding."""

COMPUTED = 1e-6
"""Ratio to their standard deviations below which residuals are rounding: of values computed, not measured."""

UNSEEN_DISTORTION, UNSEEN_BEND, MOST_POINTS_OF_SCORE = 4.0, 10.0, 20_000
"""Standard deviations of a distortion that could go unseen; a bend is worth a note from so many standard deviations of
the heights on; points beyond which it is asked only with tests of observations: it takes another factor."""

# --- after: rejections

SMALL_TEST = 2.0
"""Relative orientation rejects points for large residuals, and with smaller ones than this for one reason alone."""

FEWEST_MEETING, MEETING, APART, MOST_MEETING, MOST_IMAGES = 3, 5.0, 3.0, 30, 4
"""Rays that meet by more than chance, and by how many standard deviations they may miss, or times what rays in use do;
times that by which they are off the first place; rays of a point of which all pairs are tried; images told of one."""

CONTROL_SHARE = 1.0 / 3.0
"""Of control, of what the block gives without its errors: then it adds 5.4 % (lecture notes on close range, 5.1)."""

MOST_MIRRORED = 30
"""Models of which an axis is reversed on trial: each costs two adjustments, and more are joined by points in relief."""

# --- left out

SAME_UNIT = 0.01
"""A distance this near to one in another unit, as a share of it, is in that unit."""
