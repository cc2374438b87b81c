"""Where image points lie in their images: cells with a point, pairs of images beside each other, the most weakly tied.

Cells and pairs are told of blocks with many image points, as programs find them in pixels. Points that are measured at
standard positions are fewer than cells, and an image is not worse for cells without one.
"""

import contextlib

import numpy as np
from scipy import sparse

from aatri.adapters.interior.image_pixels import CELLS, filled_cells, places_in_images
from aatri.arrays import Bool, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.errors import AatriError
from aatri.pixels.reading import reduced_jpeg
from aatri.report.drawing.overlays import ImagePair, cells_picture, pair_picture
from aatri.report.drawing.picture import Picture
from aatri.report.drawing.rays import rays_in_use
from aatri.report.sections.tables import MOST_ROWS, Columns, PageTable, all_rows

LONGEST_PX = 900
"""Of a photograph on the page."""


def tie_point_pictures(block: Block, solution: Solution | None, pairs: tuple[Int, Int, Int]) -> list[Picture]:
    """The cells of the images, and pairs of images: the weakest, the median, the one with most points left out."""
    points = np.bincount(block.image_points.image, minlength=len(block.images))
    digital = block.cameras.image_coordinates[block.images.camera] == "pixel"
    if not digital.any() or not points.any() or np.median(points[points > 0]) < CELLS**2:
        return []
    used = rays_in_use(block, solution)
    pictures = [
        cells_picture(block.images.id, filled_cells(block, used), np.flatnonzero(block.images.active & digital))
    ]
    for name, title, images in _chosen(block, used, pairs):
        if digital[list(images)].all():
            pictures.append(pair_picture(name, title, _pair(block, used, images)))
    return pictures


def _chosen(block: Block, used: Bool, pairs: tuple[Int, Int, Int]) -> list[tuple[str, str, tuple[int, int]]]:
    """Of the strongest ties of the images the weakest and the median; of all pairs that with most points left out."""
    left, right, count = pairs
    if not len(count):
        return []
    one, other, points = np.append(left, right), np.append(right, left), np.append(count, count)
    order = np.lexsort((other, -points, one))
    best = order[np.append(True, np.diff(one[order]) > 0)]
    best = best[np.lexsort((one[best], points[best]))]
    chosen = [
        (name, title, (min(one[k], other[k]), max(one[k], other[k])))
        for name, title, k in (
            ("pair_weakest", "The weakest of the strongest ties of the images", best[0]),
            ("pair_median", "The median of the strongest ties of the images", best[len(best) // 2]),
        )
    ]
    out = _left_out(block, used)
    if out.data.max(initial=0) > 0:
        k = int(np.argmax(out.data))
        chosen.append(("pair_left_out", "The pair with most points left out", (out.row[k], out.col[k])))
    first = {images: (name, title) for name, title, images in reversed(chosen)}
    return [(name, title, images) for name, title, images in chosen if first[images][0] == name]


def _left_out(block: Block, used: Bool) -> sparse.coo_matrix:
    """How many points that two images both have are left out in one of them, the first image before the second.

    With S = U + L, used and left out: S S' - U U' = L S' + U L', products with the few of L.
    """
    at, shape = block.image_points, (len(block.images), len(block.points))
    left_out, in_use = (
        sparse.csr_matrix((np.ones(len(rows), dtype=np.int32), (at.image[rows], at.point[rows])), shape=shape)
        for rows in (np.flatnonzero(~used), np.flatnonzero(used))
    )
    if not left_out.nnz:
        return sparse.coo_matrix((shape[0], shape[0]), dtype=np.int32)
    return sparse.triu(left_out @ (left_out + in_use).T + in_use @ left_out.T, k=1).tocoo()


def _pair(block: Block, used: Bool, images: tuple[int, int]) -> ImagePair:
    """The points that two images share, where they lie in each, and the photographs where the files are there."""
    at = block.image_points
    one, other = (np.flatnonzero(at.image == image) for image in images)
    points, a, b = np.intersect1d(at.point[one], at.point[other], return_indices=True)
    a, b = one[a], other[b]
    return ImagePair(
        names=(str(block.images.id[images[0]]), str(block.images.id[images[1]])),
        size=block.cameras.format[block.images.camera[list(images)]],
        jpeg=(_photograph(block, images[0]), _photograph(block, images[1])),
        point=block.points.id[points],
        place=np.stack([places_in_images(block, a), places_in_images(block, b)], axis=1),
        used=used[a] & used[b],
    )


def _photograph(block: Block, image: int) -> bytes:
    with contextlib.suppress(AatriError):  # moved since, or no extra to read it with: the points are drawn alone
        path = str(block.images.path[image])
        return reduced_jpeg(path, LONGEST_PX) if path else b""
    return b""


def weakest_images(block: Block, pairs: tuple[Int, Int, Int]) -> PageTable | None:
    """Images by their strongest tie, the weakest first: with whom, by how many points, and to how many in all."""
    left, right, count = pairs
    one, other, points = np.append(left, right), np.append(right, left), np.append(count, count)
    order = np.lexsort((-points, one))
    first = np.append(True, np.diff(one[order]) > 0)[: len(order)]
    best = order[first]
    partners = np.bincount(one, minlength=len(block.images))
    weakest = best[np.argsort(points[best], kind="stable")][:MOST_ROWS]
    columns: Columns = {
        "image": block.images.id[one],
        "best tied to": block.images.id[other],
        "common points": points,
        "tied to images": partners[one],
    }
    return all_rows("Images by their strongest tie, the weakest first", columns, weakest)
