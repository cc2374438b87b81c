"""How well images are tied: overlap, rays per point, angles of intersection, common points; sigma over the block."""

from itertools import pairwise

import numpy as np
from scipy import sparse

from aatri.adjustment.statistics.limits import WEAK_DATUM
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.ids import several
from aatri.report.drawing.charts import counts_chart
from aatri.report.drawing.picture import Marks, Picture, steps_of
from aatri.report.drawing.plan import footprints, ground_positions, image_positions
from aatri.report.drawing.rays import measured_on_ground_m, used_rays
from aatri.report.drawing.scales import length_text, near, round_below, thinned
from aatri.units import alike

CELLS = 48
"""Cells of the overlap along the longer side of the block, more where images are small."""

MOST_CELLS = 20000

MOST_TIES = 60000
WIDTHS = (0.3, 0.7, 1.3, 2.2)
"""Of the lines of ties, from the weakest quarter to the strongest, px."""

RAYS = ("1", "2", "3", "4 or 5", "6 or more")
"""Classes of the picture: an error shows at two rays in part, at three as such; from four on it shows in which ray."""

MOST_RAYS = 60
"""Of a point, of which angles are formed."""


def overlap_picture(block: Block, solution: Solution) -> Picture | None:
    """In how many images each cell of the ground is seen."""
    feet = footprints(block, solution)
    feet = feet[np.isfinite(feet).all(axis=(1, 2))]
    if len(feet) < 2:
        return None
    feet = feet[near(feet.mean(axis=1))]
    low, high = feet.min(axis=(0, 1)), feet.max(axis=(0, 1))
    foot = float(np.median(np.ptp(feet, axis=1).min(axis=1)))
    side = max(min(float((high - low).max()) / CELLS, foot / 4), float(np.sqrt((high - low).prod() / MOST_CELLS)))
    n = np.maximum(np.ceil((high - low) / side).astype(int), 1)
    x, y = (low[k] + side * (np.arange(n[k]) + 0.5) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)
    number = np.zeros(grid.shape[:2], int)
    cells = ((feet.min(axis=1) - low) / side).astype(int), ((feet.max(axis=1) - low) / side).astype(int) + 1
    for corners, edge, (i, j), (k, m) in zip(feet, np.roll(feet, -1, axis=1) - feet, *(c.tolist() for c in cells)):
        away = grid[i:k, j:m, None] - corners
        turn = edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0]
        number[i:k, j:m] += (turn >= 0).all(axis=2) | (turn <= 0).all(axis=2)
    centres, count = grid.reshape(-1, 2), number.ravel()
    quarter = 0.5 * side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    marks = []
    for low_n, high_n, colour, fill in (
        (1, 1, "soft", 0.3),
        (2, 2, "blue", 0.1),
        (3, 4, "blue", 0.25),
        (5, 8, "blue", 0.45),
        (9, 10**9, "blue", 0.65),
    ):
        rows = np.flatnonzero((count >= low_n) & (count <= high_n))
        name = f"{low_n}" if low_n == high_n else f"{low_n} to {high_n}" if high_n < 10**9 else f"{low_n} or more"
        tells = [f"seen from {several(k, 'image')}" for k in count[rows]]
        areas = centres[rows, None] + quarter
        marks.append(Marks("areas", areas, colour, name, 0.0, fill, ids=[""] * len(rows), tells=tells))
    covered = count[count > 0]
    if not len(covered):
        return None
    caption = (
        f"Number of images that see a place, by their footprints on the mean height: {np.median(covered):.0f} in the "
        "middle of the block (median). Grey is seen once, as rims are, and gives no point."
    )
    return Picture("overlap", "Overlap", caption, marks)


def rays_pictures(block: Block, solution: Solution) -> list[Picture]:
    """Points by the number of their rays: where, and how many."""
    rays, ground = solution.points.rays, ground_positions(block, solution)[:, :2]
    rows = np.flatnonzero((rays > 0) & np.isfinite(ground).all(axis=1))
    if not len(rows):
        return []
    rows = rows[near(ground[rows])]
    drawn = rows[thinned(len(rows))]
    marks = [
        Marks(
            "dots",
            ground[rows, :2],
            colour,
            f"{name} rays",
            4.0,
            ids=block.points.id[rows].tolist(),
            tells=[several(k, "ray") for k in rays[rows].tolist()],
        )
        for rows, colour, name in reversed(steps_of(-rays.astype(float), [-5.5, -3.5, -2.5, -1.5], RAYS[::-1], drawn))
    ]
    few = int((rays[rows] == 2).sum())
    caption = (
        f"Points by the number of images that measured them, {rays[rows].mean():.1f} in the mean. {few:,} of "
        f"{len(rows):,} have two rays: an error of theirs shows in half of its directions only."
    )
    caption += f" {len(drawn):,} are drawn." if len(drawn) < len(rows) else ""
    most = int(np.quantile(rays[rows], 0.999)) + 1
    edges = np.arange(0.5, most + 1.0)
    names = {float(k): str(k) for k in range(1, most + 1, 1 + most // 13)}
    count = np.bincount(np.minimum(rays[rows], most), minlength=most + 1)[1:]
    chart = counts_chart(
        "ray_counts", "Rays per point", "Points by the number of their rays.", "rays", edges, count, names
    )
    return [Picture("rays", "Rays per point", caption, marks), chart]


def intersection_angles(block: Block, solution: Solution) -> Float:
    """The largest angle between two rays of a point, of at most `MOST_MARKS` points.

    Returns
    -------
    (n,) float64, rad
        Of the points with two rays or more.
    """
    image, point = used_rays(block, solution)
    xyz, centre = solution.points.xyz_m, solution.images.position_m
    located, oriented = (np.asarray(np.isfinite(places).all(axis=1)) for places in (xyz, centre))
    good = located[point] & oriented[image]
    crossing = np.flatnonzero(np.bincount(point[good], minlength=len(xyz)) > 1)
    of_point = np.zeros(len(xyz), dtype=bool)
    of_point[crossing[thinned(len(crossing))]] = True
    good &= of_point[point]
    order = np.flatnonzero(good)[np.argsort(point[good], kind="stable")]
    away = centre[image[order]] - xyz[point[order]]
    away /= np.linalg.norm(away, axis=1)[:, None]
    row_point, largest = point[order], np.zeros(len(xyz))
    for step in range(1, min(int(np.bincount(row_point).max(initial=1)), MOST_RAYS)):
        same = np.flatnonzero(row_point[step:] == row_point[:-step])
        sine = np.linalg.norm(np.cross(away[same], away[same + step]), axis=1)
        angle = np.arctan2(sine, np.einsum("ni,ni->n", away[same], away[same + step]))
        np.maximum.at(largest, row_point[same], angle)
    return np.asarray(largest[of_point])


def angles_chart(angles_rad: Float) -> Picture | None:
    """How the rays of points intersect."""
    if not len(angles_rad):
        return None
    degrees = np.degrees(angles_rad)
    edges = np.linspace(0.0, max(10.0 * np.ceil(degrees.max() / 10.0), 10.0), 31)
    caption = (
        f"The largest angle between two rays of each of {len(degrees):,} points: {np.median(degrees):.0f} degrees "
        f"(median), the smallest {degrees.min():.1f}. Heights are weak where it is small: by about the distance over "
        "the base."
    )
    count = np.histogram(degrees, edges)[0]
    return counts_chart("angles", "Intersection angles", caption, "degrees", edges, count)


def common_points(block: Block, solution: Solution | None) -> tuple[Int, Int, Int]:
    """Pairs of images, the first before the second, and how many points both have measured."""
    image, point = used_rays(block, solution)
    ones = np.ones(len(image), dtype=np.int32)
    seen = sparse.csr_matrix((ones, (image, point)), shape=(len(block.images), len(block.points)))
    pairs = sparse.triu(seen @ seen.T, k=1).tocoo()
    return pairs.row.astype(np.int64), pairs.col.astype(np.int64), pairs.data.astype(np.int64)


def ties_picture(block: Block, solution: Solution | None, pairs: tuple[Int, Int, Int]) -> Picture | None:
    """The graph of the images: lines between those with common points, the wider the more."""
    centres = image_positions(block, solution)[:, :2]
    located: Bool = np.asarray(np.isfinite(centres).all(axis=1))
    located[located] = near(centres[located])
    left, right, count = pairs
    rows = np.flatnonzero(located[left] & located[right])
    if not len(rows):
        return None
    strongest = rows[np.argsort(-count[rows], kind="stable")]
    drawn = strongest[:MOST_TIES]
    edges = np.unique(np.quantile(count[drawn], [0.25, 0.5, 0.75]).round()).astype(int)
    marks = []
    for k, (low, high) in enumerate(zip([1, *edges], [*edges, 10**9])):
        of_step = drawn[(count[drawn] >= low) & (count[drawn] < high)]
        ends = np.stack([centres[left[of_step]], centres[right[of_step]]], axis=1)
        name = f"{low} or more" if high == 10**9 else several(low, "common point")
        name = f"{low} to {several(high - 1, 'common point')}" if low < high - 1 < 10**9 - 1 else name
        tells = [several(n, "common point") for n in count[of_step].tolist()]
        ids = [f"{a} to {b}" for a, b in zip(block.images.id[left[of_step]], block.images.id[right[of_step]])]
        marks.append(Marks("segments", ends, "blue", name, WIDTHS[k], ids=ids, tells=tells))
    images = np.flatnonzero(located)
    partners = np.bincount(np.concatenate([left, right]), minlength=len(centres))[images]
    tells = [f"tied to {several(n, 'image')}" for n in partners.tolist()]
    ids = block.images.id[images].tolist()
    marks.append(Marks("dots", centres[images], "ink", "images", 4.0, ids=ids, tells=tells))
    caption = "Images with common points: the wider the line, the more. A block that hangs by thin lines bends there."
    caption += f" The {len(drawn):,} strongest of {len(rows):,} are drawn." if len(drawn) < len(rows) else ""
    return Picture("ties", "Ties between images", caption, marks)


def sigma_pictures(block: Block, solution: Solution) -> list[Picture]:
    """Standard deviations of the points over the block, in plan and in height.

    Regular blocks have 1 to 4 times what an image point measures on the ground; red is beyond `WEAK_DATUM` times that,
    where a check warns of a weak datum.
    """
    ground, on_ground_m = ground_positions(block, solution)[:, :2], measured_on_ground_m(block, solution)
    weak_m = WEAK_DATUM * on_ground_m
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", solution.points.covariance_m2))
    pictures = []
    for name, title, values in (
        ("sigma_plan", "in plan", np.hypot(sigma[:, 0], sigma[:, 1])),
        ("sigma_height", "in height", sigma[:, 2]),
    ):
        rows = np.flatnonzero(np.isfinite(values) & (values > 0) & np.isfinite(ground).all(axis=1))
        if len(rows) < 2:
            continue
        rows = rows[near(ground[rows])]
        drawn = rows[thinned(len(rows))]
        low, high = np.quantile(values[rows], [0.05, 0.95])
        step = round_below(max((high - low) / 3, 1e-9 * high))
        edges = step * (np.ceil(low / step) + np.arange(4))
        texts, unit = alike(edges.tolist(), step)
        lengths = [f"{text} {unit}" for text in texts]
        names = [
            f"below {lengths[0]}",
            *(f"{a} to {b}" for a, b in pairwise(lengths)),
            f"{lengths[-1]} or more",
        ]
        marks = [
            Marks(
                "dots",
                ground[rows],
                colour,
                label,
                4.5,
                ids=block.points.id[rows].tolist(),
                tells=[length_text(float(v)) for v in values[rows]],
            )
            for rows, colour, label in [
                *steps_of(values, edges, names, drawn[~(values[drawn] > weak_m)]),
                (drawn[values[drawn] > weak_m], "red", f"beyond {length_text(weak_m)}"),
            ]
            if len(rows)
        ]
        worst = rows[int(np.argmax(values[rows]))]
        caption = (
            f"{length_text(float(np.median(values[rows])))} (median), "
            f"the largest {length_text(float(values[worst]))} at {block.points.id[worst]}. Control is worth most "
            "where they are large."
        )
        if np.isfinite(on_ground_m):
            caption += (
                f" An image point measures {length_text(on_ground_m)} on the ground, and regular blocks reach 1 to 4 "
                f"times that; red would be beyond {WEAK_DATUM:.0f} times."
            )
        pictures.append(Picture(name, f"Standard deviations {title}", caption, marks))
    return pictures
