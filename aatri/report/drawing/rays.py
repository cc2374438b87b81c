"""The rays of image points: which are in use, which images see a point, and at what scale.

The scale number of an image point is its distance from the projection centre along the camera's axis, divided by the
principal distance; a standard deviation in the image, times that, is what the image point measures on the ground.

Image points are drawn in their images, too: the cells that have one, and two images beside each other with what they
share.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.ids import rows_of
from aatri.report.drawing.picture import Backdrop, Marks, Picture
from aatri.report.drawing.scales import thinned

MOST_IMAGES = 60
"""Of which cells are drawn: of more, those with the fewest."""

IN_A_ROW = 10
FEW, HALF = 0.3, 0.6
"""Shares of the cells with a point, between the colours; below the first `tie_points` names an image."""

GAP = 0.06
"""Between two images beside each other, of the width of one."""

MOST_JOINED = 40
"""Lines from one image to the other; more hide the images."""


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


@dataclass(frozen=True, eq=False)
class ImagePair:
    """Two images with the points that both have."""

    names: tuple[str, str]
    size: Float
    """(2, 2). Width and height of each, px or mm."""
    jpeg: tuple[bytes, bytes]
    """Photographs, upright as they are measured; empty where there is none."""
    point: Text
    place: Float
    """(n, 2, 2). In each image: in widths and heights from its lower left corner."""
    used: Bool
    """(n,). In both."""


def cells_picture(names: Text, filled: Bool, images: Int) -> Picture:
    """The cells of images with a point, of at most `MOST_IMAGES` images with the fewest.

    Parameters
    ----------
    names : (n,) str
    filled : (n, rows, columns) bool
        Rows from below.
    images : (m,) int
        Of which there may be pictures.
    """
    share = filled.mean(axis=(1, 2))
    fewest = images[np.argsort(share[images], kind="stable")]
    drawn = fewest[:MOST_IMAGES]
    rows, columns = filled.shape[1:]
    place = np.arange(len(drawn))
    corner = np.column_stack([place % IN_A_ROW, -(place // IN_A_ROW)]) * np.array([1.25, 1.4])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    marks = []
    for colour, name, low, high in (
        ("red", f"less than {FEW:.0%} of the cells have a point", -1.0, FEW),
        ("amber", f"less than {HALF:.0%}", FEW, HALF),
        ("blue", "more", HALF, 2.0),
    ):
        of_step = np.flatnonzero((share[drawn] >= low) & (share[drawn] < high))
        image, row, column = np.nonzero(filled[drawn[of_step]])
        cell = (np.column_stack([column, row])[:, None] + square) / np.array([columns, rows])
        tells = [f"{k} of {rows * columns} cells" for k in filled[drawn[of_step]].sum(axis=(1, 2)).tolist()]
        marks.append(Marks("areas", corner[of_step][image][:, None] + cell, colour, name, 0.0, 0.55))
        frames = corner[of_step][:, None] + square
        ids = names[drawn[of_step]].tolist()
        marks.append(Marks("areas", frames, colour, width=0.8, ids=ids, tells=tells))
    marks.append(Marks("texts", corner + np.array([-0.04, -0.2]), "ink", ids=names[drawn].tolist()))
    few = int((share[images] < FEW).sum())
    caption = (
        f"Cells of the images, {columns} x {rows} each, that have an image point in use; in the mean "
        f"{share[images].mean():.0%}. Nothing ties the rest of an image, and a block with many empty cells bends: "
        f"{few:,} of {len(images):,} images {'has' if few == 1 else 'have'} a point in less than {FEW:.0%}."
    )
    caption += f" Drawn: the {len(drawn)} with the fewest." if len(drawn) < len(images) else ""
    return Picture("cells", "Cells with a point", caption, marks, ground=False, width=900.0)


def pair_picture(name: str, title: str, pair: ImagePair) -> Picture:
    """Two images beside each other, their common points green, those that are left out red."""
    width = pair.size[0, 0] * (1 + GAP)
    at = pair.place * pair.size + np.array([[0.0, 0.0], [width, 0.0]])
    low = np.array([[0.0, 0.0], [width, 0.0]])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    marks = [Marks("areas", low[:, None] + square * pair.size[:, None], "soft")]
    for colour, words, mask in (("green", "used", pair.used), ("red", "left out", ~pair.used)):
        rows = np.flatnonzero(mask)
        joined = rows[thinned(len(rows), MOST_JOINED)]
        marks.append(Marks("segments", at[joined], colour, width=0.5))
        ids = np.repeat(pair.point[rows], 2).tolist()
        tells = [words] * len(ids)
        marks.append(Marks("dots", at[rows].reshape(-1, 2), colour, words, 4.0, ids=ids, tells=tells))
    lower = np.array([[0.0, 0.0], [width, 0.0]]) - [0.0, 0.05 * pair.size[:, 1].max()]
    marks.append(Marks("texts", lower, "ink", ids=list(pair.names)))
    out = int((~pair.used).sum())
    caption = (
        f"{pair.names[0]} and {pair.names[1]}: {len(pair.used) - out:,} common points are used, {out:,} left out. "
        "Lines join some of them: those that cross the others are wrong."
    )
    backdrops = [Backdrop(jpeg, a, a + size) for jpeg, a, size in zip(pair.jpeg, low, pair.size) if jpeg]
    return Picture(name, title, caption, marks, ground=False, backdrops=backdrops, width=900.0)
