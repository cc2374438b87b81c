"""The single models of a block: pairs of images and their common points, with corrected coordinates."""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.evaluation.limits import ACROSS_BASE, FEWEST_OF_MODEL, LEAST_BASE
from aatri.geometry.collinearity import in_image_axes, project
from aatri.observations.poses import Poses
from aatri.orientation.relative.orientations import common_points

CORRECTED = ("none", "table", "brown")
"""Distortions that correct what is measured: the corrected coordinates are those of a central projection."""


IMAGES_AT_ONCE = 1_000
"""Images without a strip that are compared with all others at once."""


@dataclass(frozen=True)
class ModelRays:
    """Points of models, each with its two rays."""

    left: Int
    right: Int
    """(k,). Images of each model."""
    model: Int
    point: Int
    """(m,)."""
    xy_mm: Float
    sigma_mm: Float
    """(m, 2, 2), mm. Of the left and the right ray: corrected coordinates from the principal point, their standard
    deviations."""
    c_mm: Float
    """(m, 2), mm."""


@dataclass(frozen=True)
class StereoPairs:
    """Pairs of images that may be models, whose rays are corrected piece by piece: those of all take much memory."""

    block: Block
    solution: Solution
    poses: Poses
    xyz_m: Float
    images: Int
    """(k, 2)."""
    begin: Int
    """(n_images + 1,). First ray of each image."""
    row: Int
    point: Int
    """(n,) int64. Rows of the rays among the residuals, by image and point, and their points."""

    def rays(self, first: int = 0, last: int | None = None) -> ModelRays:
        """The models among the pairs first ... last - 1, or all, with the rays of their common points."""
        r, image_of_row = self.solution.residuals, self.block.image_points.image
        images = self.images[first:last]
        start, *common = common_points(images, self.begin, self.point)
        enough = np.diff(start) >= FEWEST_OF_MODEL
        model = np.repeat(np.arange(np.count_nonzero(enough)), np.diff(start)[enough])
        rays = np.stack(common, axis=1)[np.repeat(enough, np.diff(start))]
        point = self.point[rays[:, 0]]
        xy, sigma, c = np.empty((len(rays), 2, 2)), np.empty((len(rays), 2, 2)), np.empty((len(rays), 2))
        for k in (0, 1):
            row = self.row[rays[:, k]]
            image = image_of_row[r.row[row]]
            c[:, k] = self.solution.cameras.principal_distance_mm[self.block.images.camera[image]]
            u = in_image_axes(self.poses.position_m[image], self.poses.ground_from_image[image], self.xyz_m[point])
            xy[:, k], sigma[:, k] = project(u, c[:, k]) - r.residual[row, :2], r.sigma[row, :2]
        left, right = images[enough].T
        return ModelRays(left, right, model, point, xy, sigma, c)


def stereo_pairs(block: Block, solution: Solution, poses: Poses, xyz_m: Float) -> StereoPairs | None:
    """The pairs of a block that may be models; None where it has none.

    Corrected coordinates are those that the adjusted point would have, less the residual.

    Parameters
    ----------
    solution : Solution
        With residuals of its image points.
    poses : Poses
        In the Cartesian frame of the adjustment.
    xyz_m : (n_points, 3) float64, m
        In the same frame.
    """
    r = solution.residuals
    rows = r.used("image_point")
    rows = rows[r.row[rows] >= 0]
    image, point = block.image_points.image[r.row[rows]], block.image_points.point[r.row[rows]]
    finite = finite_rows(xyz_m)[point] & finite_rows(poses.position_m)[image]
    finite &= np.isfinite(r.residual[rows, :2]).all(axis=1)
    finite &= np.isin(block.cameras.distortion, CORRECTED)[block.images.camera[image]]
    rows, image, point = rows[finite], image[finite], point[finite]
    if not len(rows):
        return None
    images = _candidates(block, image, point)
    base = np.linalg.norm(poses.position_m[images[:, 1]] - poses.position_m[images[:, 0]], axis=1)
    distance = np.median(np.linalg.norm(xyz_m[point] - poses.position_m[image], axis=1))
    n_points = len(block.points)
    seen, ray = np.unique(image.astype(np.int64) * n_points + point, return_index=True)
    begin = np.searchsorted(seen, np.arange(len(block.images) + 1, dtype=np.int64) * n_points)
    images = images[base > LEAST_BASE * distance]
    return StereoPairs(block, solution, poses, xyz_m, images, begin, rows[ray], seen % n_points)


def ray_pairs(block: Block, solution: Solution, poses: Poses, xyz_m: Float) -> ModelRays | None:
    """The models of a block and their points, as `stereo_pairs`; None where it has none."""
    pairs = stereo_pairs(block, solution, poses, xyz_m)
    rays = pairs.rays() if pairs is not None else None
    return rays if rays is not None and len(rays.left) else None


def model_axes(poses: Poses, rays: ModelRays) -> Float:
    """Axes of models, (k, 3, 3) by columns: along the base, across it, up; NaN where the base points along the view."""
    base = poses.position_m[rays.right] - poses.position_m[rays.left]
    e1 = base / np.linalg.norm(base, axis=1, keepdims=True)
    up = poses.ground_from_image[rays.left][:, :, 2] + poses.ground_from_image[rays.right][:, :, 2]
    e3 = up - (up * e1).sum(axis=1, keepdims=True) * e1
    length = np.linalg.norm(e3, axis=1, keepdims=True)
    e3 = np.where(length > ACROSS_BASE, e3 / np.where(length > 0, length, 1.0), np.nan)
    return np.stack([e1, np.cross(e3, e1), e3], axis=2)


def _candidates(block: Block, image: Int, point: Int) -> Int:
    """Neighbours in a strip, and each image without one with that it shares most points with, (n_pairs, 2)."""
    from scipy.sparse import csr_array  # slow to import

    n, strip = len(block.images), block.images.strip
    used = np.bincount(image, minlength=n) > 0
    order = np.lexsort((block.images.sequence, strip))
    order = order[(strip[order] >= 0) & used[order]]
    pairs = np.stack([order[:-1], order[1:]], axis=1)[strip[order[:-1]] == strip[order[1:]]]
    single = np.flatnonzero((strip < 0) & used)
    if not len(single):
        return np.asarray(pairs)
    seen = csr_array((np.ones(len(image)), (image, point)), shape=(n, len(block.points)))
    parts = [pairs]
    for own in np.array_split(single, -(-len(single) // IMAGES_AT_ONCE)):
        shared = (seen[own] @ seen.T).tocoo()
        others = own[shared.row] != shared.col
        row, partner, count = shared.row[others], shared.col[others], shared.data[others]
        order = np.lexsort((partner, -count, row))
        row, first = np.unique(row[order], return_index=True)
        parts.append(np.sort(np.stack([own[row], partner[order[first]]], axis=1), axis=1))
    pairs = np.concatenate(parts)
    return np.asarray(pairs[np.sort(np.unique(pairs, axis=0, return_index=True)[1])])
