"""The kinds of artifact by name."""

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.information import Information
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.tables.schema import Artifact

KINDS: dict[str, type[Artifact]] = {
    kind.kind: kind for kind in (Block, ImagePoints, Models, Strips, Solution, Evaluation, Information)
}
