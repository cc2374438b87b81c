"""Orientations, points, residuals, calibration and reliability of a Solution."""

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
from aatri.report.drawing.svg import Picture
from aatri.report.sections import calibration, network, observations, reliability
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, residual_classes
from aatri.report.view.numbers import DASH, digits, metres, number


def show(made: PageSection, solution: Solution, around: Surroundings) -> None:
    """Add what was adjusted, the most asked for first."""
    made.tables.extend(
        present(
            residual_classes(solution),
            *calibration.parameter_tables(solution),
            reliability.variance_table(solution),
            *reliability.reliability_tables(solution),
            _orientations(solution),
            observations.of_images(solution),
            _orderings(solution),
            _transformations(solution.transformations),
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
    angles = np.full((len(images), 3), np.nan)
    angles[images.oriented] = np.degrees(
        angles_from_rotation(images.ground_from_image[images.oriented], "omega-phi-kappa")
    )
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", images.covariance))
    columns: Columns = {
        "image": images.id,
        **axes(("X m", "Y m", "Z m"), images.position_m, digits(3)),
        **axes(("omega deg", "phi deg", "kappa deg"), angles, digits(5)),
    }
    if np.isfinite(sigma).any():
        columns |= axes(("sX m", "sY m", "sZ m"), sigma, metres)
        columns |= axes(("sd1 mdeg", "sd2 mdeg", "sd3 mdeg"), 1e3 * np.degrees(sigma[:, 3:]), number)
    columns["image points"] = images.image_points
    return all_rows("Orientations: omega, phi, kappa; sd1 to sd3 turns about the ground axes", columns)


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
        finite = np.isfinite(xy).all(axis=1) & np.isfinite(v[inside]).all(axis=1)
        pictures += present(image_vectors(xy[finite], v[inside][finite]))
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
    of, words = (
        {"position": (xyz, residuals.residual[rows])},
        ("Residuals of observed positions", "adjusted minus observed"),
    )
    return present(plan_vectors(of, *words), height_bars(of, *words))


def _ties(solution: Solution) -> dict[str, tuple[Float, Float]]:
    """Places and residuals of the ties of each strip that are used."""
    r = solution.residuals
    rows = np.flatnonzero((r.kind == "strip_tie") & r.active)
    if not len(rows):
        return {}
    ids = solution.points.id
    order = np.argsort(ids, kind="stable")
    xyz = solution.points.xyz_m[order[np.searchsorted(ids[order], r.point[rows])]]
    strips, number = np.unique(r.image[rows], return_inverse=True)
    by_strip = np.argsort(number, kind="stable")
    parts = np.split(by_strip, np.searchsorted(number[by_strip], np.arange(1, len(strips))))
    return {str(s): (xyz[part], r.residual[rows[part]]) for s, part in zip(strips, parts)}


def _orderings(solution: Solution) -> PageTable | None:
    o = solution.orderings
    if o is None:
        return None
    columns: Columns = {
        "order": [f"{order}{' (used)' if used else ''}" for order, used in zip(o.ordering, o.used)],
        "textbook, images": (o.textbook_images, lambda images: number(int(images)) if images >= 0 else DASH),
        "found, images": o.images,
        "unknowns": o.unknowns,
        "border": o.border,
        "elements stored": o.stored,
        "Gflop": o.gflop,
    }
    return all_rows("Half bandwidth; textbook: 2N + 2 across, n + 3 along N strips of n images", columns)


def _transformations(t: StripTransformations) -> PageTable | None:
    columns: Columns = {"strip": t.id, "model": t.model, "parameter": t.parameter}
    return all_rows("Transformations", columns | {"value": (t.value, "{:.8g}".format), "sigma": t.sigma})
