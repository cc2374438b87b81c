"""Role `design`: what a planned layout will be worth. block, solution -> Evaluation."""

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "solution": Solution}, kind=Evaluation)
