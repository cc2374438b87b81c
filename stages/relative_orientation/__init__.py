"""Role `relative_orientation`: neighbouring images to each other. block, image_points -> Models."""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "image_points": ImagePoints}, kind=Models)
