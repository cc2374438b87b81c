"""Thresholds of the bundle's start, terms, datum and terrain, each once, with its source."""

# --- adjusted terms

NEARLY_ADJUSTED = 3.0
"""Median of |v| / sigma up to which the coordinates computed from a start are adjusted ones: a lens whose correction
changes by 3 % of a distance (1 mm at 100 mm, with the third power) has terms there that are 0.1 sigma off."""

FARTHEST_ADJUSTED = 0.1
"""Part of c by which each adjusted coordinate is at most off the measured one. A start that fits is off by
`NEARLY_ADJUSTED` standard deviations, 30 um or 0.0003 c of film; at 0.1 c (6 degrees) the point is another one, and the
seventh power of a coordinate metres off would outweigh all others of its column."""

# --- from afar

FAR_SIGMA0 = 3.0
"""sigma0 above which an adjustment that did not go straight, by linear steps alone, is tried from elsewhere."""

SAME_START = 1e-6
"""Starts whose rotations agree within so many radians, and places within this share of the block, are the same one."""

MOST_FRUITLESS = 2
"""Adjustments of one block that other starts do not better, after which one that converges is taken as it is."""

# --- free datum

OPEN_DIRECTION = 1e-8
"""Share of a movement by which observations change at most where the datum is open in its direction."""

SAME_COST = 1e-6
"""Largest relative change of the cost by a movement that no observation should see."""

NEARLY_SAME_COST = 1e-12
"""Relative change of the cost by such a movement below which all that moves has followed exactly."""

# --- strip numbering

LEAST_TURN_DEG, LONGEST_STEP, FEWEST_OF_LINE = 45.0, 3.0, 3
"""Where a line of flight ends: half of the least turn between the lines of a plan, those that cross at right angles;
three bases, as images with the textbook's overlap of 60 % have no ground in common beyond 2.5; two images show no
direction that a third one could keep."""

# --- terrain test

LONGER_EDGE, FAR_FROM_TERRAIN, BEYOND_TERRAIN = 1.5, 0.2, 0.5
"""Times the largest test of points with three rays: these, with breaklines and houses among them, show how long the
tails are. Shares of the flying height by which points with three rays, and points that no others surround, are off."""

LEAST_DOWNWARDS = 0.5
"""Cosine between the axes of images and the nadir below which they see no terrain but walls: oblique flights have
0.7."""

SURROUNDED = 0.5
"""Cofactor of the height of a plane above which a point lies outside of its neighbours; of 12 around it it is 0.08."""

# --- variance groups

RUNAWAY_FACTOR = 1e3
"""Factor of the standard deviation of a group of observations, or its inverse, beyond which it runs away: the group
cannot be told from the others."""
