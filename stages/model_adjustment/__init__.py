"""Role `model_adjustment`: all models together to the ground, each as a rigid body.

block, image_points, strips, models, initial -> Solution; the orientations of the images follow by resection.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.plugin import Role

ROLE = Role(
    ports={"block": Block, "image_points": ImagePoints, "strips": Strips, "models": Models, "initial": Solution},
    kind=Solution,
)
