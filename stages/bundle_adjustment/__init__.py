"""Role `bundle_adjustment`: all rays together. block, image_points, initial -> Solution.

A variant with additional parameters may take them, weighted, from a finished bundle of the same cameras: `calibration`;
the observations of another block come by its reduced normal equations: `information`.
"""

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
    },
    kind=Solution,
)
