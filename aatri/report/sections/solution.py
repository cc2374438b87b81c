"""What a Solution tells: precision, orientations, residuals in pictures, iterations; orders and transformations."""

import numpy as np

from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution, StripTransformations
from aatri.geometry.rotations import angles_from_rotation
from aatri.ids import natural_order, rows_of
from aatri.report.drawing.charts import residual_histogram
from aatri.report.drawing.picture import Picture
from aatri.report.drawing.vectors import MOST_STRIPS, both, image_vectors, tie_pictures
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, lengths, observation_classes
from aatri.report.view.numbers import angle_units, number, small_angle
from aatri.units import DASH, decimals, digits, together

MOST_CAMERAS = 6


def show(made: PageSection, solution: Solution, around: Surroundings) -> None:
    """Add what a stage adjusted: residuals by kind, orders, transformations; of results on the way their ties, too."""
    classes = around.classes if solution is around.solution else observation_classes(solution)
    made.tables.extend(present(classes, _orderings(solution), _transformations(solution.transformations)))
    if solution is not around.solution:
        made.pictures.extend(tie_residuals(solution))


def precision_table(solution: Solution) -> PageTable | None:
    """Standard deviations of points, projection centres and rotations: median and largest."""
    with np.errstate(invalid="ignore"):
        points = np.sqrt(np.einsum("nii->ni", solution.points.covariance_m2))
        images = np.sqrt(np.einsum("nii->ni", solution.images.covariance))
    rows = []
    for what, names, sigma, ids, is_length in (
        ("points", "XYZ", points, solution.points.id, True),
        ("projection centres", "XYZ", images[:, :3], solution.images.id, True),
        ("rotations about", "XYZ", images[:, 3:], solution.images.id, False),
    ):
        for k, axis in enumerate(names):
            with_sigma = np.flatnonzero(sigma[:, k] > 0)
            if len(with_sigma):
                worst = with_sigma[int(np.argmax(sigma[with_sigma, k]))]
                figures = (float(np.median(sigma[with_sigma, k])), float(sigma[worst, k]))
                texts = [together([f]) if is_length else small_angle(f) for f in figures]
                rows.append((what, axis, str(ids[worst]), *texts))
    heads = ("standard deviation of", "axis", "largest at", "median", "largest")
    return PageTable("Theoretical standard deviations, a priori", heads, rows, 3) if rows else None


def orientations(block: Block | None, solution: Solution) -> PageTable | None:
    """Exterior orientation of all images, strip by strip, to digits of their standard deviations."""
    images = solution.images
    if not images.oriented.any():
        return None
    units = angle_units.get()
    angles = np.full((len(images), 3), np.nan)
    angles[images.oriented] = units.per_rad * (
        angles_from_rotation(images.ground_from_image[images.oriented], "omega-phi-kappa")
    )
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", images.covariance))
    has_sigma = np.isfinite(sigma).any(axis=0) & (np.nan_to_num(sigma) > 0).any(axis=0)
    size = [
        float(np.median(sigma[:, axes][np.nan_to_num(sigma[:, axes]) > 0])) if has_sigma[axes].any() else np.nan
        for axes in (slice(0, 3), slice(3, 6))
    ]
    columns: Columns = {
        "image": images.id,
        **axes(("X m", "Y m", "Z m"), images.position_m, digits(decimals(size[0]))),
        **axes(
            tuple(f"{a} {units.angle}" for a in ("omega", "phi", "kappa")),
            angles,
            digits(decimals(units.per_rad * size[1]) + 2 * np.isnan(size[1])),
        ),
    }
    if has_sigma.any():
        columns |= lengths("sX sY sZ", sigma[:, :3])
        columns |= axes(
            tuple(f"{a} {units.small}" for a in ("s about X", "Y", "Z")),
            units.small_per_rad * sigma[:, 3:],
            digits(decimals(units.small_per_rad * size[1])),
        )
    columns["image points"] = images.image_points
    caption = "Orientations: omega, phi, kappa"
    caption += "; standard deviations of the turns about the ground axes" if has_sigma.any() else ""
    return all_rows(caption, columns, _flown(block, solution), kept=True)


def _flown(block: Block | None, solution: Solution) -> Int:
    """Images strip by strip in natural order, along the flight."""
    order = natural_order(solution.images.id)
    if block is None or not len(block.strips):
        return order
    place = np.empty(len(block.strips), int)
    place[natural_order(block.strips.id)] = np.arange(len(block.strips))
    strip = np.where(block.images.strip[order] >= 0, place[block.images.strip[order]], len(block.strips))
    return np.asarray(order[np.lexsort((np.nan_to_num(block.images.sequence[order]), strip))])


def iterations_table(solution: Solution) -> PageTable | None:
    """sigma0 before every step, how long it was, how much damped."""
    h = solution.history
    with np.errstate(invalid="ignore"):
        sigma0 = np.sqrt(h.cost / solution.redundancy) if solution.redundancy else np.full(len(h), np.nan)
    columns: Columns = {
        "iteration": [str(k + 1) for k in range(len(h))],
        "sigma0": sigma0,
        "step in sigmas": (h.decrement, lambda v: DASH if np.isnan(v) else f"{v:.2g}"),
        "damping": h.damping,
    }
    caption = "Iterations of the last round; each round leaves out or readmits observations, or changes weights"
    return all_rows(caption, columns)


def image_residual_pictures(solution: Solution, around: Surroundings) -> list[Picture]:
    """Mean residuals over the format of each camera, and the histogram of normalised residuals."""
    residuals, points = solution.residuals, around.image_points
    used = residuals.used("image_point")
    if not len(used):
        return []
    v, sigma = residuals.residual[used, :2], residuals.sigma[used, :2]
    pictures = []
    if points is not None and around.block is not None:
        placed = residuals.row[used]
        inside = (placed >= 0) & (placed < len(points.measurements))
        xy = np.full((len(used), 2), np.nan)
        xy[inside] = points.measurements.xy_mm[placed[inside]]
        image = np.where(inside, around.block.image_points.image[np.where(inside, placed, 0)], 0)
        finite = np.isfinite(xy).all(axis=1) & np.isfinite(v).all(axis=1)
        for camera in np.unique(around.block.images.camera[image[finite]])[:MOST_CAMERAS]:
            usable = finite & (around.block.images.camera[image] == camera)
            pictures += present(image_vectors(str(around.block.cameras.id[camera]), xy[usable], v[usable]))
    weighted = np.isfinite(v) & (sigma > 0)
    share = solution.redundancy / solution.observations if solution.observations else 0.0
    if weighted.any() and share > 0:
        pictures += present(residual_histogram(v[weighted] / sigma[weighted] / share**0.5))
    return pictures


def position_pictures(solution: Solution) -> list[Picture]:
    """Residuals of observed positions in plan and in height: what is common to neighbours is drift."""
    residuals, images = solution.residuals, solution.images
    rows = residuals.used("position")
    if len(rows) < 2:
        return []
    ids = residuals.image[rows]
    xyz = images.position_m[rows_of(ids, images.id)]
    by_kind = {"position": (xyz, residuals.residual[rows], ids.tolist())}
    return both("positions", by_kind, "Residuals of observed positions", "adjusted minus observed")


def tie_residuals(solution: Solution) -> list[Picture]:
    """Residuals of the ties of each strip that are used, in natural order of the strips."""
    r = solution.residuals
    rows = r.used("strip_tie")
    if not len(rows):
        return []
    strips = sorted(set(r.image[rows].tolist()))
    drawn = {strips[k]: rows[r.image[rows] == strips[k]] for k in natural_order(strips)[:MOST_STRIPS]}
    ends = np.cumsum([len(of) for of in drawn.values()])
    point = np.split(rows_of(r.point[np.concatenate([*drawn.values()])], solution.points.id), ends[:-1])
    xyz = {s: solution.points.xyz_m[of] for s, of in zip(drawn, point)}
    ties = {s: (xyz[s], r.residual[of], r.point[of].tolist()) for s, of in drawn.items()}
    return tie_pictures(ties, len(strips) - len(drawn))


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
