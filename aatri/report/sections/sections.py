"""One section of the page per stage: what it made, in tables and pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from markupsafe import Markup

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.errors import AatriError
from aatri.ids import rows_of
from aatri.report.drawing.charts import convergence_chart, residual_histogram
from aatri.report.drawing.plan import ground_positions
from aatri.report.drawing.residual_plots import error_field_pictures, height_bars, image_vectors, plan_vectors
from aatri.report.numbers import DASH, number, seconds
from aatri.report.run_view import RunView, StageView
from aatri.report.sections import tables
from aatri.report.sections.tables import PageTable

Picture = tuple[Markup, str]
LONG = 15
"""Options and transformations of more rows are folded."""


@dataclass(frozen=True)
class Section:
    """What the page tells of one stage."""

    stage: StageView
    seconds: str
    notes: list[str] = field(default_factory=list)
    tables: list[PageTable] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)


@dataclass(frozen=True)
class Surroundings:
    """What sections draw from besides their own artifact."""

    block: Block | None
    image_points: ImagePoints | None
    solution: Solution | None


def section(run: RunView, stage: StageView, around: Surroundings) -> Section:
    """The section of a stage, also of one that failed or whose artifact cannot be read."""
    record = stage.record or {}
    made = Section(stage, seconds(record.get("seconds")))
    single, by_axis = tables.without_axis(stage.metrics), tables.by_axis("Metrics by axis", stage.metrics)
    made.tables.extend(_present(tables.pairs("Metrics", single), by_axis))
    options = (stage.failure or record).get("options", {})
    made.tables.extend(_present(_folded(tables.pairs("Options", options))))
    if stage.status != "done":
        return made
    try:
        artifact = run.artifact(stage)
    except AatriError as error:
        made.notes.append(f"The artifact cannot be shown: {error}")
        return made
    _CONTENT[type(artifact)](made, artifact, around)
    made.tables.extend(_present(tables.suspects_table(artifact.suspects) if hasattr(artifact, "suspects") else None))
    return made


def difference_pictures(evaluation: Evaluation, around: Surroundings, kinds: tuple[str, ...]) -> list[Picture]:
    """Differences at points of the given kinds, in plan and height."""
    if around.block is None:
        return []
    differences, ground = evaluation.differences, ground_positions(around.block, around.solution)
    groups = {}
    for kind in kinds:
        of_kind = differences.kind == kind
        rows = rows_of(differences.point[of_kind], around.block.points.id)
        groups[kind] = (ground[rows[rows >= 0]], differences.difference_m[of_kind][rows >= 0])
    return _present(plan_vectors(groups), height_bars(groups))


def _block(made: Section, block: Block, _around: Surroundings) -> None:
    cameras = block.cameras
    columns = {
        "camera": lambda k: str(cameras.id[k]),
        "kind": lambda k: str(cameras.kind[k]),
        "distortion": lambda k: str(cameras.distortion[k]),
        "principal distance mm": lambda k: f"{cameras.principal_distance_mm[k]:.4f}",
        "principal point x mm": lambda k: f"{cameras.principal_point_mm[k, 0]:.4f}",
        "y mm": lambda k: f"{cameras.principal_point_mm[k, 1]:.4f}",
    }
    made.tables.extend(_present(tables.first_rows("Cameras", cameras, columns, 3), tables.rejects_table(block.rejects)))


def _image_points(made: Section, artifact: ImagePoints, _around: Surroundings) -> None:
    corrections, residuals = artifact.corrections, artifact.fiducial_residuals
    columns = {
        "correction": lambda k: str(corrections.name[k]),
        "largest um": lambda k: number(1e3 * float(corrections.largest_mm[k])),
    }
    made.tables.extend(_present(tables.first_rows("Corrections applied", corrections, columns, 1)))
    if residuals.active.any():
        v = 1e3 * residuals.residual_mm[residuals.active]
        made.notes.append(
            f"Fiducial residuals: RMS x {np.sqrt((v[:, 0] ** 2).mean()):.2f}, "
            f"y {np.sqrt((v[:, 1] ** 2).mean()):.2f} um, largest {np.abs(v).max():.2f} um, of {len(v):,} marks."
        )


def _models(made: Section, models: Models, _around: Surroundings) -> None:
    unformed = models.unformed
    columns = {
        "left": lambda k: str(models.images.id[unformed.left[k]]),
        "right": lambda k: str(models.images.id[unformed.right[k]]),
        "why": lambda k: str(unformed.reason[k]),
        "common points": lambda k: number(int(unformed.common_points[k])),
    }
    made.tables.extend(_present(tables.first_rows("Neighbours without a model", unformed, columns, 3)))


def _strips(made: Section, strips: Strips, _around: Surroundings) -> None:
    gaps = strips.gaps
    columns = {
        "strip": lambda k: str(gaps.strip[k]),
        "before the gap": lambda k: str(gaps.left[k]),
        "after": lambda k: str(gaps.right[k]),
        "why": lambda k: str(gaps.reason[k]),
    }
    made.tables.extend(_present(tables.first_rows("Gaps", gaps, columns, 4)))


def _solution(made: Section, solution: Solution, around: Surroundings) -> None:
    parameters, transformations = solution.parameters, solution.transformations
    made.tables.extend(
        _present(
            tables.residual_classes(solution),
            tables.first_rows("Parameters", parameters, _parameter_columns(parameters), 3),
            _orderings(solution),
            _folded(tables.first_rows("Transformations", transformations, _transformation_columns(transformations), 3)),
        )
    )
    if solution.error_fields is not None and len(solution.error_fields):
        made.pictures.extend(error_field_pictures(solution.error_fields))
    made.pictures.extend(image_residual_pictures(solution, around))
    made.pictures.extend(_present(convergence_chart(solution.history.cost, solution.history.decrement)))


def _evaluation(made: Section, evaluation: Evaluation, around: Surroundings) -> None:
    made.notes.append(evaluation.verdict)
    made.tables.extend(tables.point_tables(evaluation))
    made.pictures.extend(difference_pictures(evaluation, around, ("control", "check")))
    made.pictures.extend(difference_pictures(evaluation, around, ("truth",)))


def image_residual_pictures(solution: Solution, around: Surroundings) -> list[Picture]:
    """Mean residuals over the image format, and the histogram of normalised residuals."""
    residuals = solution.residuals
    used = np.flatnonzero((residuals.kind == "image_point") & residuals.active)
    if not len(used):
        return []
    v, sigma = residuals.residual[used, :2], residuals.sigma[used, :2]
    pictures = []
    if around.image_points is not None:
        placed = residuals.row[used]
        inside = (placed >= 0) & (placed < len(around.image_points.measurements))
        xy = around.image_points.measurements.xy_mm[placed[inside]]
        known = np.isfinite(xy).all(axis=1) & np.isfinite(v[inside]).all(axis=1)
        pictures += _present(image_vectors(xy[known], v[inside][known]))
    weighted = np.isfinite(v) & (np.nan_to_num(sigma) > 0)
    share = solution.redundancy / solution.observations if solution.observations else 0.0
    if weighted.any() and share > 0:
        pictures += _present(residual_histogram(v[weighted] / sigma[weighted] / share**0.5))
    return pictures


def _orderings(solution: Solution) -> PageTable | None:
    o = solution.orderings
    if o is None:
        return None
    columns = {
        "order": lambda k: f"{o.ordering[k]}{' (used)' if o.used[k] else ''}",
        "textbook, images": lambda k: number(int(o.textbook_images[k])) if o.textbook_images[k] >= 0 else DASH,
        "found, images": lambda k: number(int(o.images[k])),
        "unknowns": lambda k: number(int(o.unknowns[k])),
        "border": lambda k: number(int(o.border[k])),
        "elements stored": lambda k: number(int(o.stored[k])),
        "Gflop": lambda k: number(float(o.gflop[k])),
    }
    return tables.first_rows("Half bandwidth; textbook: 2N + 2 across, n + 3 along N strips of n images", o, columns, 1)


def _parameter_columns(p: Any) -> dict[str, Callable[[int], str]]:
    return {
        "group": lambda k: str(p.group[k]),
        "of": lambda k: str(p.object[k]),
        "parameter": lambda k: str(p.name[k]),
        "value": lambda k: number(float(p.value[k])),
        "sigma": lambda k: number(float(p.sigma[k])),
    }


def _transformation_columns(t: Any) -> dict[str, Callable[[int], str]]:
    return {
        "strip": lambda k: str(t.id[k]),
        "model": lambda k: str(t.model[k]),
        "parameter": lambda k: str(t.parameter[k]),
        "value": lambda k: f"{float(t.value[k]):.8g}",
        "sigma": lambda k: number(float(t.sigma[k])),
    }


def _folded(table: PageTable | None) -> PageTable | None:
    """A long table shows only its caption until it is opened."""
    return replace(table, folded=True) if table is not None and len(table.rows) > LONG else table


def _present(*items: Any) -> list[Any]:
    return [item for item in items if item is not None]


_CONTENT: dict[type, Callable[[Section, Any, Surroundings], None]] = {
    Block: _block,
    ImagePoints: _image_points,
    Models: _models,
    Strips: _strips,
    Solution: _solution,
    Evaluation: _evaluation,
}
