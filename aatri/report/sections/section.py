"""One section of the page per stage: what it made, in tables and pictures. Each kind of artifact has a file."""

from collections.abc import Callable
from typing import Any

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.errors import AatriError
from aatri.report.sections import block, image_points, models, solution, strips, tables
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.suspects import suspects_tables
from aatri.report.view.run_view import RunView, StageView

_SHOW: dict[type, Callable[[PageSection, Any, Surroundings], None]] = {
    Block: block.show,
    ImagePoints: image_points.show,
    Models: models.show,
    Strips: strips.show,
    Solution: solution.show,
}


def section(run: RunView, stage: StageView, around: Surroundings) -> PageSection:
    """The section of a stage, also of one that failed or whose artifact cannot be read."""
    record = stage.record or {}
    made = PageSection(f"stage-{stage.name}", stage.name)
    single, by_axis = tables.without_axis(stage.metrics), tables.by_axis("Metrics by axis", stage.metrics)
    made.tables.extend(present(tables.pairs("Metrics", single), by_axis))
    options = (stage.failure or record).get("options", {})
    made.tables.extend(present(tables.folded(tables.pairs("Options", options))))
    if stage.status != "done":
        return made
    try:
        artifact = run.artifact(stage)
    except AatriError as error:
        made.notes.append(f"The artifact cannot be shown: {error}")
        return made
    if type(artifact) in _SHOW:  # an Information is told by its metrics, an Evaluation by the answer to accuracy
        _SHOW[type(artifact)](made, artifact, around)
    if hasattr(artifact, "suspects") and artifact is not around.solution:
        made.tables.extend(suspects_tables(artifact.suspects))
    return made
