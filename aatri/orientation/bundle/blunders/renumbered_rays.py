"""Wrong numbers: a rejected image point that lies where another point is expected, which the image does not have.

With the measured coordinates of the ray, and the ground point q of the other in place of its own,

    v = computed(pose, X_q) - measured,      |v| <= limit FITS sigma      in x and y

q is looked for among the points that are seen in images which share points with this one; those that the image has
itself, in use, are no choice. Where points lie dense one of them may fit by chance: the number n of them that fall into
an image of area A, and the box of the bound, give the chance n (4 bound_x bound_y) / A, which must be below
`FALSE_ALARM`, and the fit must be the only one.
"""

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.statistics.limits import FALSE_ALARM
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.geometry.collinearity import in_image_axes, project
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import renumbered_records
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.blunders.limits import FITS_NUMBER, MOST_IN_AN_IMAGE, NEAR_NUMBER
from aatri.orientation.bundle.blunders.swaps import Swap, are_image_points
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import OtherNumber


def renumbered_rays(
    result: BundleResult,
    rays: ImagePointRows | None,
    rejected: tuple[Bool, ...],
    limit: float,
    swapped: Sequence[Swap] = (),
) -> list[OtherNumber]:
    """Ground points that rejected image points fit.

    Parameters
    ----------
    rays : ImagePointRows, optional
        The image points.
    rejected : tuple of (n,) bool
        Rejected, kind by kind.
    limit : float
        In standard deviations.
    swapped : sequence of Swap
        Those of them that fit each other's number.
    """
    if rays is None:
        return []
    place = next(i for i, o in enumerate(result.observations) if are_image_points(o.observed, rays))
    swapped_rows = [row for swap in swapped if swap.place == place for row in (swap.first, swap.second)]
    rows = np.setdiff1d(np.flatnonzero(rejected[place] & result.image_adjusted[rays.image]), swapped_rows)
    if not len(rows):
        return []
    visibility = _Visibility(rays, result.ray_used & result.point_adjusted[rays.point], len(result.xyz_m))
    pairs: list[tuple[Int, Int, Float]] = []
    by_image = rows[np.argsort(rays.image[rows], kind="stable")]
    images, first = np.unique(rays.image[by_image], return_index=True)
    extents = _extents(rays)
    for image, image_rows in zip(images.tolist(), np.split(by_image, first[1:])):
        if len(image_rows) <= MOST_IN_AN_IMAGE:
            around = visibility.around(image)
            pairs.append(_near(result.adjusted.state, rays, image_rows, around, extents[image], limit))
    if not pairs:
        return []
    row, point, chance = (np.concatenate(parts) for parts in zip(*pairs))
    return _fitting(result, rays, row, point, chance, limit)


class _Visibility:
    """Which points which images see, both ways."""

    def __init__(self, rays: ImagePointRows, used: Bool, n_points: int) -> None:
        from scipy.sparse import csr_array  # slow to import

        rows = np.flatnonzero(used)
        n_images = int(rays.image.max(initial=-1)) + 1
        ones, shape = np.ones(len(rows), dtype=np.int32), (n_images, n_points)
        self.points_of = csr_array((ones, (rays.image[rows], rays.point[rows])), shape=shape)
        self.images_of = self.points_of.T.tocsr()

    def around(self, image: int) -> Int:
        """Points of the images that share some with this one, but for its own."""
        own = self.points_of[[image]].indices
        images = np.unique(self.images_of[own].indices)
        return np.setdiff1d(self.points_of[images].indices, own)


def _extents(rays: ImagePointRows) -> Float:
    """Least and largest x and y of what is measured in each image, (n_images, 2, 2), mm."""
    extents = np.tile(np.array([[np.inf], [-np.inf]]), (int(rays.image.max()) + 1, 1, 2))
    for axis, coordinate_mm in enumerate(rays.xy_mm.T):  # column by column: ufunc.at takes a sixth of the time
        np.minimum.at(extents[:, 0, axis], rays.image, coordinate_mm)
        np.maximum.at(extents[:, 1, axis], rays.image, coordinate_mm)
    return extents


def _near(
    state: State, rays: ImagePointRows, rows: Int, points: Int, extent_mm: Float, limit: float
) -> tuple[Int, Int, Float]:
    """Image points of one image and the points near them: rows, points, and the chance of such a fit."""
    empty = np.zeros(0, dtype=np.int64)
    if not len(points):
        return empty, empty, np.zeros(0)
    image, c = int(rays.image[rows[0]]), float(rays.c_mm[rows[0]])
    poses = state[POSE]
    X0, R = poses.position_m[[image]], poses.ground_from_image[[image]]
    u = in_image_axes(np.repeat(X0, len(points), axis=0), np.repeat(R, len(points), axis=0), state[POINT][points])
    in_front = u[:, 2] < 0
    points, xy = points[in_front], project(u[in_front], np.full(int(in_front.sum()), c))
    low, high = extent_mm
    count = int(((xy >= low) & (xy <= high)).all(axis=1).sum())
    near = (np.abs(rays.xy_mm[rows][:, None, :] - xy) <= NEAR_NUMBER * c).all(axis=2)
    i, k = np.nonzero(near)
    box = (2.0 * limit * FITS_NUMBER * rays.sigma_mm[rows]).prod(axis=1)
    chance = np.minimum(1.0, count * box / max(float((high - low).prod()), 1e-12))
    return rows[i], points[k], chance[i]


def _fitting(
    result: BundleResult, rays: ImagePointRows, row: Int, point: Int, chance: Float, limit: float
) -> list[OtherNumber]:
    """Of pairs of image point and ground point those that fit, where just one does."""
    if not len(row):
        return []
    records = renumbered_records(rays, tuple(p.given for p in result.parameters), row, point)
    v = np.abs(records.evaluate(result.adjusted.state, np.arange(len(row)))[0])
    bound = limit * FITS_NUMBER * rays.sigma_mm[row]
    fits = (v <= bound).all(axis=1) & (chance <= FALSE_ALARM)
    unique = fits & (np.bincount(row[fits], minlength=len(rays.image))[row] == 1)
    renumbered = unique & (point != rays.point[row])
    return [OtherNumber(int(r), int(p)) for r, p in zip(row[renumbered], point[renumbered])]
