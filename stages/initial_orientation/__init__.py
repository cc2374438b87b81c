"""Role `initial_orientation`: any images, no start values. block, image_points, models (optional) -> Solution."""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "image_points": ImagePoints, "models": Models}, kind=Solution)
