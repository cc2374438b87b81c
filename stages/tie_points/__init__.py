"""Role `tie_points`: image points from the pixels of a block, or fewer of them. block, solution (optional) -> Block."""

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "solution": Solution}, kind=Block)
