"""Which tie points are kept where there are many: long tracks first, spread over the cells of their images.

A point is kept if at least two of its images have a cell that is not yet full: so every image keeps points where it has
any, Gruber positions and more, and an image with few keeps them all. Points do not help beyond that: precision grows
with the root of their number, the time of the adjustment with the number.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int


def kept_points(point: Int, image: Int, cell: Int, sigma: Float, *, per_cell: int, least: int) -> Bool:
    """Which of the image points (n,) stay.

    Parameters
    ----------
    point, image : (n,) int
        Rows of points and images.
    cell : (n,) int
        Cell of the image in which it lies.
    sigma : (n,) float64
        Standard deviations: of tracks of one length the more precise come first.
    per_cell : int
        Points that fill a cell.
    least : int
        An image with no more points than this keeps them all.
    """
    order = np.argsort(point, kind="stable")
    ids, first, rays = np.unique(point[order], return_index=True, return_counts=True)
    worst = np.maximum.reduceat(sigma[order], first) if len(ids) else np.zeros(0)
    weak = np.bincount(image, minlength=int(image.max(initial=-1)) + 1) <= least
    filled: dict[tuple[int, int], int] = {}
    places = list(zip(image[order].tolist(), cell[order].tolist()))
    kept = np.zeros(len(point), dtype=bool)
    for k in np.lexsort((worst, -rays)).tolist():
        rows = slice(int(first[k]), int(first[k] + rays[k]))
        open_ = sum(filled.get(place, 0) < per_cell for place in places[rows])
        if open_ < min(2, rays[k]) and not weak[image[order[rows]]].any():
            continue
        kept[order[rows]] = True
        for place in places[rows]:
            filled[place] = filled.get(place, 0) + 1
    return kept
