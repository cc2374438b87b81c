"""Role `interior_orientation`: from the measured system to photo coordinates. block -> ImagePoints."""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.plugin import Role

ROLE = Role(ports={"block": Block}, kind=ImagePoints)
