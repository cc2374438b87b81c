"""Accuracy: the verdict, every control and check point, single models, free strips, and pictures of the differences."""

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.evaluation import (
    Differences,
    Displacements,
    Evaluation,
    LayoutPoints,
    ModelSetUps,
    ParameterChanges,
    SingleModels,
    StripErrors,
)
from aatri.ids import rows_of
from aatri.report.drawing.charts import growth_charts
from aatri.report.drawing.picture import Picture
from aatri.report.drawing.plan import ground_positions, rejected_control
from aatri.report.drawing.vectors import bars, both
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, lengths
from aatri.report.view.numbers import angle_units
from aatri.units import digits


def show(made: PageSection, evaluation: Evaluation, around: Surroundings) -> None:
    """Add verdict, points and pictures."""
    made.notes.extend(evaluation.verdict.splitlines())
    made.tables.extend(point_tables(evaluation))
    made.tables.extend(present(models_table(evaluation.models), set_ups_table(evaluation.set_ups)))
    made.tables.extend(present(strips_table(evaluation.strip_errors)))
    if evaluation.strip_errors is not None:
        made.pictures.extend(growth_charts(evaluation.strip_errors))
    made.tables.extend(present(moved_table(evaluation.displacements), changes_table(evaluation.parameter_changes)))
    made.pictures.extend(movement_pictures(evaluation.displacements))
    made.tables.extend(present(layout_table(evaluation.layout_points)))
    made.pictures.extend(layout_pictures(evaluation.layout_points))
    made.pictures.extend(difference_pictures(evaluation, around, ("control", "check")))
    made.pictures.extend(difference_pictures(evaluation, around, ("truth",)))


def point_tables(evaluation: Evaluation) -> list[PageTable]:
    """Differences at all control and check points, the largest first, with the largest share of its sigma."""
    return present(*(_table(evaluation.differences, kind) for kind in ("control", "left_out", "check")))


def _table(differences: Differences, kind: str) -> PageTable | None:
    rows = np.flatnonzero(differences.kind == kind)
    d, s = differences.difference_m, differences.sigma_m
    rows = rows[np.argsort(-np.nan_to_num(np.abs(d[rows])).max(axis=1), kind="stable")]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.fmax.reduce(np.where(s > 0, np.abs(d) / s, np.nan), axis=1)
    columns: Columns = {
        "point": differences.point,
        **lengths("dX dY dZ", d),
        **lengths("sX sY sZ", s),
        "largest d / s": (ratio, digits(1)),
        "rays": differences.rays,
    }
    where = "control points predicted without themselves" if kind == "left_out" else f"{kind} points"
    return all_rows(f"Differences at {where}, the largest first", columns, rows, kept=kind != "left_out")


def models_table(models: SingleModels | None) -> PageTable | None:
    """Single models, those with the largest y-parallaxes first."""
    if models is None:
        return None
    order = np.argsort(-np.nan_to_num(models.parallax_rms_um), kind="stable")
    columns: Columns = {
        "left": models.left,
        "right": models.right,
        "largest at": models.parallax_max_at,
        "points": models.points,
        "y-parallax um": models.parallax_rms_um,
        "largest um": models.parallax_max_um,
        "over sigma": models.w_rms,
    }
    for name, values in (("adjusted", models.adjusted_rms_m), ("check", models.check_rms_m)):
        columns |= lengths(" ".join(f"{name}_{a}" for a in "XYZ"), values)
    caption = "Single models with the orientations of the block, RMS; minus adjusted and check coordinates"
    return all_rows(caption, columns, order)


def set_ups_table(made: ModelSetUps | None) -> PageTable | None:
    """Set-ups of stereo models; their pass points are in the artifact and its export."""
    if made is None:
        return None
    units = angle_units.get()
    columns: Columns = {"left": made.left, "right": made.right, "points": made.points}
    columns |= {"base m": np.linalg.norm(made.base_m, axis=1), "1 : scale": made.scale_number}
    for side, angles in (("left", made.left_rad), ("right", made.right_rad)):
        heads = (f"{side} {a} {units.angle}" for a in ("phi", "omega", "kappa"))
        columns |= axes(heads, units.per_rad * angles, "{:.5f}".format)
    return all_rows("Set-ups of stereo models, x along the base", columns, np.arange(len(made)))


def strips_table(errors: StripErrors | None) -> PageTable | None:
    """Errors of free strips by number of the model."""
    if errors is None:
        return None
    thousandths = {
        "height, RMS": errors.rms[:, 2],
        "law": errors.law[:, 2],
        **{f"mean d{a}": errors.mean[:, i] for i, a in enumerate("XYZ")},
    }
    columns: Columns = {
        "model": [str(model) for model in errors.model],
        "strips": errors.strips,
        "phi mrad": (1e3 * errors.turned_rad[:, 1], "{:.3f}".format),
        "law mrad": (1e3 * errors.turned_law_rad[:, 1], "{:.3f}".format),
        **{name: (1e3 * values, "{:.3f}".format) for name, values in thousandths.items()},
    }
    return all_rows("Errors along free strips; height and mean in thousandths of the first base", columns)


def moved_table(points: Displacements | None) -> PageTable | None:
    """Points at two epochs, those that have moved first."""
    if points is None:
        return None
    sigma = np.sqrt(np.einsum("nii->ni", points.covariance_m2))
    share = points.statistic / points.limit
    columns: Columns = {
        "point": points.point,
        "": np.where(points.moved, "moved", ""),
        **lengths("dX dY dZ", points.displacement_m),
        **lengths("sX sY sZ", sigma),
        "test / limit": share,
        **lengths("detectable", points.detectable_m),
    }
    caption = "Points at both epochs: displacement if the point has moved, beside those that have not; moved ones first"
    return all_rows(caption, columns, np.lexsort((-np.nan_to_num(share), ~points.moved)))


def changes_table(changes: ParameterChanges | None) -> PageTable | None:
    """Parameters of cameras at two epochs, those that have changed first."""
    if changes is None:
        return None
    share = changes.statistic / changes.limit
    columns: Columns = {
        "camera": changes.object,
        "parameter": changes.name,
        " ": np.where(changes.moved, "changed", ""),
        "change": changes.change,
        "sigma": changes.sigma,
        "difference": changes.difference,
        "test / limit": share,
        "detectable": changes.detectable,
    }
    caption = "Parameters of both calibrations: change if the parameter alone has changed; changed ones first"
    return all_rows(caption, columns, np.lexsort((-np.nan_to_num(share), ~changes.moved)))


def movement_pictures(points: Displacements | None) -> list[Picture]:
    """Displacements in plan and height, moved and stable points apart."""
    if points is None:
        return []
    groups = {
        name: (points.xyz_m[rows], points.displacement_m[rows], points.point[rows].tolist())
        for name, rows in (("stable", ~points.moved), ("moved", points.moved))
        if rows.any()
    }
    return both("displacements", groups, "Displacements", "later minus earlier")


def layout_table(points: LayoutPoints | None) -> PageTable | None:
    """Points of a planned block: the next control first, then where control would gain most."""
    if points is None:
        return None
    columns: Columns = {
        "point": points.point,
        "next": [str(k) if k else "" for k in points.order.tolist()],
        **lengths("sX sY sZ", points.sigma_m),
        **lengths("moved_X moved_Y moved_Z", points.moved_m),
        "gain, mean %": (100 * points.mean_gain, "{:.1f}".format),
        "gain, worst %": (100 * points.worst_gain, "{:.1f}".format),
    }
    caption = (
        "Planned points: standard deviations, effect of the largest error that is not detected with 80 %, and what "
        "control there would take off all variances and off the largest"
    )
    order = np.where(points.order > 0, points.order, len(points) + 1)
    return all_rows(caption, columns, np.lexsort((-np.nan_to_num(points.mean_gain), order)))


def layout_pictures(points: LayoutPoints | None) -> list[Picture]:
    """Standard deviations and undetected errors over a planned block, as bars: in plan and in height."""
    if points is None:
        return []
    pictures = []
    for short, what, size in (
        ("planned_sigma", "Standard deviations", points.sigma_m),
        ("planned_effect", "Effects of undetected errors", points.moved_m),
    ):
        for where, bar in (("plan", np.hypot(size[:, 0], size[:, 1])), ("height", size[:, 2])):
            heights = np.stack([bar * 0, bar * 0, bar], axis=1)
            groups = {
                name: (points.xyz_m[rows], heights[rows], points.point[rows].tolist())
                for name, rows in (("planned", points.order == 0), ("next control", points.order > 0))
                if rows.any()
            }
            pictures.append(bars(f"{short}_{where}", groups, f"{what} in {where}"))
    return present(*pictures)


def difference_pictures(evaluation: Evaluation, around: Surroundings, kinds: tuple[str, ...]) -> list[Picture]:
    """Differences at points of the given kinds, in plan and height; control that is left out apart."""
    if around.block is None:
        return []
    d, ground = evaluation.differences, ground_positions(around.block, around.solution)
    out = np.isin(d.point, rejected_control(around.solution))
    row = rows_of(d.point, around.block.points.id)
    groups: dict[str, tuple[Float, Float, list[str]]] = {}
    for kind in kinds:
        of_kind = (d.kind == kind) & (row >= 0)
        parts = {kind: of_kind & ~out, "control left out": of_kind & out} if kind == "control" else {kind: of_kind}
        groups |= {
            name: (ground[row[rows]], d.difference_m[rows], d.point[rows].tolist())
            for name, rows in parts.items()
            if name == kind or rows.any()
        }
    if kinds == ("truth",):
        return both("truth", groups, "Errors", "solution minus truth")
    return both("differences", groups, "Differences", "solution minus given")
