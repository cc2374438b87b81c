"""Role `image_refinement`: corrections of the photo coordinates. block, image_points -> ImagePoints.

A variant that compensates what an adjustment has left over takes its solution too; one that corrects what a test field
has found, the `calibration`: a finished bundle of the same cameras.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.plugin import Role

ROLE = Role(
    ports={"block": Block, "image_points": ImagePoints, "solution": Solution, "calibration": Solution},
    kind=ImagePoints,
)
