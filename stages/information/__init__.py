"""Role `information`: what a block says of the unknowns it shares with others. block, image_points, initial ->
Information."""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.information import Information
from aatri.artifacts.solution import Solution
from aatri.plugin import Role

ROLE = Role(
    ports={
        "block": Block,
        "image_points": ImagePoints,
        "initial": Solution,
        "calibration": Solution,
        "information": Information,
        "other": Block,
    },
    kind=Information,
)
