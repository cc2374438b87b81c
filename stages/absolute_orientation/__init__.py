"""Role `absolute_orientation`: free strips to the ground, approximately. block, strips, image_points -> Solution."""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "strips": Strips, "image_points": ImagePoints}, kind=Solution)
