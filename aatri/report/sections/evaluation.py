"""Accuracy: the verdict, every control and check point, single models, free strips, and pictures of the differences."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.evaluation import Differences, Evaluation, SingleModels, StripErrors
from aatri.ids import rows_of
from aatri.report.drawing.growth import growth_chart
from aatri.report.drawing.plan import ground_positions
from aatri.report.drawing.residual_plots import height_bars, plan_vectors
from aatri.report.numbers import DASH, metres, number
from aatri.report.sections import tables
from aatri.report.sections.parts import Picture, Section, Surroundings, present
from aatri.report.sections.tables import PageTable


def show(made: Section, evaluation: Evaluation, around: Surroundings) -> None:
    """Add verdict, points and pictures."""
    made.notes.append(evaluation.verdict)
    made.tables.extend(point_tables(evaluation))
    made.tables.extend(present(models_table(evaluation.models), strips_table(evaluation.strip_errors)))
    if evaluation.strip_errors is not None:
        made.pictures.extend(present(growth_chart(evaluation.strip_errors)))
    made.pictures.extend(difference_pictures(evaluation, around, ("control", "check")))
    made.pictures.extend(difference_pictures(evaluation, around, ("truth",)))


def point_tables(evaluation: Evaluation) -> list[PageTable]:
    """Differences at all control and check points, the largest first, with the largest share of its sigma."""
    return present(*(_table(evaluation.differences, kind) for kind in ("control", "left_out", "check")))


def _table(differences: Differences, kind: str) -> PageTable | None:
    rows = np.flatnonzero(differences.kind == kind)
    if not len(rows):
        return None
    d, s = differences.difference_m[rows], differences.sigma_m[rows]
    order = np.argsort(-np.nan_to_num(np.abs(d)).max(axis=1), kind="stable")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.fmax.reduce(np.where(s > 0, np.abs(d) / s, np.nan), axis=1)
    columns: tables.Cells = {
        "point": lambda k: str(differences.point[rows[order[k]]]),
        **{f"d{a} m": tables.formatted(d[order, i], metres) for i, a in enumerate("XYZ")},
        **{f"s{a} m": tables.formatted(s[order, i], metres) for i, a in enumerate("XYZ")},
        "largest d / s": lambda k: number(float(ratio[order[k]])) if np.isfinite(ratio[order[k]]) else DASH,
        "rays": lambda k: number(int(differences.rays[rows[order[k]]])),
    }
    where = "control points predicted without themselves" if kind == "left_out" else f"{kind} points"
    return tables.all_rows(f"Differences at {where}, the largest first", rows, columns, 1)


def models_table(models: SingleModels | None) -> PageTable | None:
    """Single models, those with the largest y-parallaxes first."""
    if models is None:
        return None
    order = np.argsort(-np.nan_to_num(models.parallax_rms_um), kind="stable")
    columns: tables.Cells = {
        "left": lambda k: str(models.left[order[k]]),
        "right": lambda k: str(models.right[order[k]]),
        "largest at": lambda k: str(models.parallax_max_at[order[k]]),
        "points": lambda k: number(int(models.points[order[k]])),
        "y-parallax um": tables.formatted(models.parallax_rms_um[order], number),
        "largest um": tables.formatted(models.parallax_max_um[order], number),
        "over sigma": tables.formatted(models.w_rms[order], number),
    }
    for name, values in (("adjusted", models.adjusted_rms_m), ("check", models.check_rms_m)):
        columns |= {f"{name} {a} m": tables.formatted(values[order, i], metres) for i, a in enumerate("XYZ")}
    caption = "Single models with the orientations of the block, RMS; minus adjusted and check coordinates"
    return tables.all_rows(caption, models, columns, 3)


def strips_table(errors: StripErrors | None) -> PageTable | None:
    """Errors of free strips by number of the model."""
    if errors is None:
        return None
    thousandths = {"height, RMS": errors.rms[:, 2], "law": errors.law[:, 2],
                   **{f"mean d{a}": errors.mean[:, i] for i, a in enumerate("XYZ")}}  # fmt: skip
    columns: tables.Cells = {
        "model": lambda k: str(errors.model[k]),
        "strips": lambda k: str(errors.strips[k]),
        "phi mrad": tables.formatted(1e3 * errors.turned_rad[:, 1], _three),
        "law mrad": tables.formatted(1e3 * errors.turned_law_rad[:, 1], _three),
        **{name: tables.formatted(1e3 * v, _three) for name, v in thousandths.items()},
    }
    caption = "Errors along free strips; height and mean in thousandths of the first base"
    return tables.all_rows(caption, errors, columns, 1)


def _three(value: float) -> str:
    return f"{value:.3f}"


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
    return present(plan_vectors(groups), height_bars(groups))
