"""Role `epochs`: what has moved between two epochs. solution, earlier (or block, earlier_block) -> Evaluation."""

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.plugin import Role

ROLE = Role(
    ports={"solution": Solution, "earlier": Solution, "block": Block, "earlier_block": Block},
    kind=Evaluation,
)
