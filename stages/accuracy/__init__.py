"""Role `accuracy`: how good a Solution is, or what the stages before it left. block, solution, strips -> Evaluation."""

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "solution": Solution, "strips": Strips}, kind=Evaluation)
