"""Orientations, points, residuals, calibration and reliability of a Solution."""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.solution import Solution, StripTransformations
from aatri.geometry.rotations import angles_from_rotation
from aatri.report.drawing.charts import convergence_chart, residual_histogram
from aatri.report.drawing.residual_plots import (
    error_field_pictures,
    height_bars,
    image_vectors,
    plan_vectors,
    tie_pictures,
)
from aatri.report.numbers import DASH, metres, number
from aatri.report.sections import calibration, network, observations, reliability, tables
from aatri.report.sections.parts import Picture, Section, Surroundings, present
from aatri.report.sections.tables import Cells, PageTable


def show(made: Section, solution: Solution, around: Surroundings) -> None:
    """Add what was adjusted, the most asked for first."""
    transformations = solution.transformations
    made.tables.extend(
        present(
            tables.residual_classes(solution),
            *calibration.parameter_tables(solution),
            reliability.variance_table(solution),
            *reliability.reliability_tables(solution),
            _orientations(solution),
            observations.of_images(solution),
            _orderings(solution),
            tables.all_rows("Transformations", transformations, _transformation_columns(transformations), 3),
        )
    )
    network.show(made, around.block, solution)
    if solution.error_fields is not None and len(solution.error_fields):
        made.pictures.extend(error_field_pictures(solution.error_fields))
    made.pictures.extend(image_residual_pictures(solution, around))
    made.pictures.extend(position_pictures(solution))
    made.pictures.extend(tie_pictures(_ties(solution)))
    made.pictures.extend(present(convergence_chart(solution.history.cost, solution.history.decrement)))


def _orientations(solution: Solution) -> PageTable | None:
    """Exterior orientation of all images, with standard deviations."""
    images = solution.images
    if not len(images):
        return None
    angles = np.full((len(images), 3), np.nan)
    angles[images.oriented] = np.degrees(
        angles_from_rotation(images.ground_from_image[images.oriented], "omega-phi-kappa")
    )
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", images.covariance))
    columns: Cells = {"image": lambda k: str(images.id[k])}
    columns |= {f"{a} m": tables.formatted(images.position_m[:, i], _millimetres) for i, a in enumerate("XYZ")}
    names = ("omega", "phi", "kappa")
    columns |= {f"{a} deg": tables.formatted(angles[:, i], _degrees) for i, a in enumerate(names)}
    if np.isfinite(sigma).any():
        columns |= {f"s{a} m": tables.formatted(sigma[:, i], metres) for i, a in enumerate("XYZ")}
        columns |= {f"sd{i - 2} mdeg": tables.formatted(1e3 * np.degrees(sigma[:, i]), number) for i in (3, 4, 5)}
    columns["image points"] = lambda k: number(int(images.image_points[k]))
    return tables.all_rows(
        "Orientations: omega, phi, kappa; sd1 to sd3 turns about the ground axes", images, columns, 1
    )


def _millimetres(value: float) -> str:
    return DASH if value != value else f"{value:.3f}"


def _degrees(value: float) -> str:
    return DASH if value != value else f"{value:.5f}"


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
        pictures += present(image_vectors(xy[known], v[inside][known]))
    weighted = np.isfinite(v) & (np.nan_to_num(sigma) > 0)
    share = solution.redundancy / solution.observations if solution.observations else 0.0
    if weighted.any() and share > 0:
        pictures += present(residual_histogram(v[weighted] / sigma[weighted] / share**0.5))
    return pictures


def position_pictures(solution: Solution) -> list[Picture]:
    """Residuals of observed positions in plan and in height: what is common to neighbours is drift."""
    residuals, images = solution.residuals, solution.images
    rows = np.flatnonzero((residuals.kind == "position") & residuals.active)
    if len(rows) < 2:
        return []
    order = np.argsort(images.id, kind="stable")
    xyz = images.position_m[order[np.searchsorted(images.id[order], residuals.image[rows])]]
    of = {"position": (xyz, residuals.residual[rows])}
    return [(picture, _of_positions(caption)) for picture, caption in present(plan_vectors(of), height_bars(of))]


def _of_positions(caption: str) -> str:
    caption = caption.replace("Differences", "Residuals of observed positions").replace("position points", "images")
    return caption.replace("solution minus given", "adjusted minus observed")


def _ties(solution: Solution) -> dict[str, tuple[Float, Float]]:
    """Places and residuals of the ties of each strip that are used."""
    r = solution.residuals
    rows = np.flatnonzero((r.kind == "strip_tie") & r.active)
    if not len(rows):
        return {}
    ids = solution.points.id
    order = np.argsort(ids, kind="stable")
    xyz = solution.points.xyz_m[order[np.searchsorted(ids[order], r.point[rows])]]
    return {str(s): (xyz[r.image[rows] == s], r.residual[rows][r.image[rows] == s]) for s in np.unique(r.image[rows])}


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
    return tables.all_rows("Half bandwidth; textbook: 2N + 2 across, n + 3 along N strips of n images", o, columns, 1)


def _transformation_columns(t: StripTransformations) -> Cells:
    return {
        "strip": lambda k: str(t.id[k]),
        "model": lambda k: str(t.model[k]),
        "parameter": lambda k: str(t.parameter[k]),
        "value": lambda k: f"{float(t.value[k]):.8g}",
        "sigma": lambda k: number(float(t.sigma[k])),
    }
