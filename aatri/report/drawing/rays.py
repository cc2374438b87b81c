"""The rays of image points: which are in use, which images see a point, and at what scale.

The scale number of an image point is its distance from the projection centre along the camera's axis, divided by the
principal distance; a standard deviation in the image, times that, is what the image point measures on the ground.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.ids import rows_of
from aatri.report.drawing.scales import thinned


def used_rays(block: Block, solution: Solution | None) -> tuple[Int, Int]:
    """Image and point of every image point in use.

    Returns
    -------
    image, point : (n,) int
    """
    used = rays_in_use(block, solution)
    return block.image_points.image[used], block.image_points.point[used]


def rays_in_use(block: Block, solution: Solution | None) -> Bool:
    """Which image points of the block are in use, (n,): active, and not left out by the adjustment."""
    used: Bool = block.image_points.active.copy()
    if solution is not None:
        residuals = solution.residuals
        rows = residuals.of_kind("image_point")
        out = residuals.row[rows[~residuals.active[rows]]]
        used[out[out >= 0]] = False
    return used


def seen_from(rays: tuple[Int, Int], points: Int, images: Int) -> list[list[int]]:
    """From which of some images each of some points is seen; `points` and `images` are rows of the block."""
    if not len(points) or not len(rays[0]):
        return []
    number, place = (
        np.full(1 + max(numbers.max(initial=-1), at.max()), -1)
        for numbers, at in ((images, rays[0]), (points, rays[1]))
    )
    number[images], place[points] = np.arange(len(images)), np.arange(len(points))
    image, point = number[rays[0]], place[rays[1]]
    shown_rays = np.flatnonzero((image >= 0) & (point >= 0))
    shown_rays = shown_rays[np.argsort(point[shown_rays], kind="stable")]
    ends = np.cumsum(np.bincount(point[shown_rays], minlength=len(points)))[:-1]
    return [part.tolist() for part in np.split(image[shown_rays], ends)]


def ray_scales(block: Block, solution: Solution) -> tuple[Int, Float, Float]:
    """Distances along the axis and scale numbers of the image points whose point and orientation are determined.

    Of more than `MOST_MARKS` as many, evenly: medians over them differ by a hundredth of the spread.

    Returns
    -------
    row : (n,) int
        Of the image points of the block.
    depth_m, scale_number : (n,) float64
    """
    m, images, points = block.image_points, solution.images, solution.points
    located: Bool = np.asarray(np.isfinite(points.xyz_m).all(axis=1))
    rows = np.flatnonzero(m.active & images.oriented[m.image] & located[m.point])
    rows = rows[thinned(len(rows))]
    view = -images.ground_from_image[m.image[rows], :, 2]
    depth_m = np.einsum("ni,ni->n", view, points.xyz_m[m.point[rows]] - images.position_m[m.image[rows]])
    return rows, depth_m, depth_m * 1e3 / principal_distances(block, solution)[block.images.camera[m.image[rows]]]


def measured_on_ground_m(block: Block, solution: Solution) -> float:
    """What an image point measures on the ground: standard deviation times scale number, median; NaN without images."""
    r = solution.residuals
    usable = r.used("image_point")
    usable = usable[r.row[usable] >= 0]
    sigma_mm = np.full(len(block.image_points), np.nan)
    sigma_mm[r.row[usable]] = r.sigma[usable, :2].mean(axis=1)
    rows, _, scale = ray_scales(block, solution)
    on_ground_m = 1e-3 * (sigma_mm[rows] * scale)
    return float(np.nanmedian(on_ground_m)) if np.isfinite(on_ground_m).any() else np.nan


def principal_distances(block: Block, solution: Solution | None) -> Float:
    """Of each camera of the block, (n,), mm: as adjusted, else as given."""
    c = block.cameras.principal_distance_mm.copy()
    if solution is not None:
        row = rows_of(solution.cameras.id, block.cameras.id)
        c[row[row >= 0]] = solution.cameras.principal_distance_mm[row >= 0]
    return c
