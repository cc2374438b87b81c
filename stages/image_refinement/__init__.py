"""Role `image_refinement`: corrections of the photo coordinates. block, image_points -> ImagePoints."""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "image_points": ImagePoints}, kind=ImagePoints)
