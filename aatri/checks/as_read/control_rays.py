"""Rays from known positions to control points, and the angles between two of them of one image.

    in the image   between (x, y, -c)_i and (x, y, -c)_j
    in space       between X_i - X0 and X_j - X0

The misfit of a pair is |difference| / angle in the image, that of an image the median over its pairs, that of a block
the median over its images.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import OBSERVED_VALUE, Block
from aatri.camera.pixels import mm_from_pixel
from aatri.checks.limits import LEAST_ANGLE_RAD, MOST_ANGLE_IMAGES, MOST_ANGLE_POINTS, UNLIKELY_SIGMAS
from aatri.observations.control import control_of


@dataclass(frozen=True)
class ControlRays:
    """Rays to control points."""

    image: Int
    point: Int
    """(k,). Rows of `position_m` and `control_m`."""
    xy_mm: Float
    """(k, 2), mm. From the principal point."""
    principal_point_mm: Float
    """(k, 2), mm. What has been subtracted."""
    c_mm: Float
    """(k,), mm."""
    position_m: Float
    """(n, 3), m."""
    control_m: Float
    """(m, 3), m. All of them known."""
    observed: bool = True
    """Most positions are observed, not only approximate."""
    sigma_m: Float | None = None
    """(n,), m. Standard deviation of a coordinate of the positions, 0 where none is known; None: of all."""
    in_table: Int | None = None
    """(m,). Rows of `control_m` in the order of their files; None: as they stand."""

    def rows_off(self, by: int) -> ControlRays:
        """With the coordinates that stand so many rows later in the table, those of its ends exchanged."""
        order = np.arange(len(self.control_m)) if self.in_table is None else self.in_table
        control_m = self.control_m.copy()
        control_m[order] = self.control_m[np.roll(order, -by)]
        return replace(self, control_m=control_m)

    @property
    def misfit_by_chance(self) -> float:
        """Misfit of a pair that errors of the positions reach by chance: of an angle a / d they change sigma / d."""
        if self.sigma_m is None or not len(self.image):
            return 0.0
        away = np.linalg.norm(self.control_m[self.point] - self.position_m[self.image], axis=1)
        return float(np.median(UNLIKELY_SIGMAS * self.sigma_m[self.image] / np.maximum(away, 1e-9)))


@dataclass(frozen=True)
class Pairs:
    """Pairs of rays of one image each."""

    image: Int
    first: Int
    second: Int

    def take(self, chosen: Bool) -> Pairs:
        """The chosen ones."""
        return Pairs(self.image[chosen], self.first[chosen], self.second[chosen])


def pairs_of(rays: ControlRays) -> Pairs:
    """Pairs of the rays of each image, but for those to nearly the same place."""
    order = np.argsort(rays.image, kind="stable")
    begin = np.unique(rays.image[order], return_index=True)[1]
    groups = [g[:: max(1, -(-len(g) // MOST_ANGLE_POINTS))] for g in np.split(order, begin[1:])]
    groups = [g for g in groups if len(g) > 1]
    groups = groups[:: max(1, -(-len(groups) // MOST_ANGLE_IMAGES))]
    first = [g[i] for g in groups for i in range(len(g)) for _ in range(i + 1, len(g))]
    second = [g[j] for g in groups for i in range(len(g)) for j in range(i + 1, len(g))]
    pairs = Pairs(rays.image[first], np.array(first, np.int64), np.array(second, np.int64))
    seen = np.maximum(angle_between(*in_image(rays, pairs)), angle_between(*in_space(rays, pairs))) > LEAST_ANGLE_RAD
    return pairs.take(seen)


def in_image(rays: ControlRays, pairs: Pairs) -> tuple[Float, Float]:
    """The two directions of each pair as measured, (n, 3) mm."""
    u = np.column_stack([rays.xy_mm, -rays.c_mm])
    return u[pairs.first], u[pairs.second]


def in_space(rays: ControlRays, pairs: Pairs) -> tuple[Float, Float]:
    """The two directions of each pair from position to control, (n, 3) m."""
    d = rays.control_m[rays.point] - rays.position_m[rays.image]
    return d[pairs.first], d[pairs.second]


def angle_between(a: Float, b: Float) -> Float:
    """Angles between directions, (n,) rad."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def misfit_of_images(rays: ControlRays, pairs: Pairs) -> Float:
    """Misfit of each image that has pairs, in their order."""
    off = misfit_of_pairs(rays, pairs)
    order = np.lexsort((off, pairs.image))
    _, begin, count = np.unique(pairs.image[order], return_index=True, return_counts=True)
    low, high = off[order][begin + (count - 1) // 2], off[order][begin + count // 2]
    return np.asarray((low + high) / 2)


def misfit_of_pairs(rays: ControlRays, pairs: Pairs) -> Float:
    """Difference of the angles of each pair, as a share of that in the image."""
    image = np.maximum(angle_between(*in_image(rays, pairs)), 1e-9)
    return np.asarray(np.abs(angle_between(*in_space(rays, pairs)) - image) / image)


def misfit(rays: ControlRays, pairs: Pairs) -> float:
    """Misfit of the block."""
    return float(np.median(misfit_of_images(rays, pairs)))


def control_rays(block: Block, xy_mm: Float, usable: Bool) -> ControlRays:
    """Rays to control with all coordinates from images with a position.

    Parameters
    ----------
    xy_mm : (k, 2) float64, mm
        Image points, from the middle of the image.
    usable : (k,) bool
    """
    control, points, c = control_of(block), block.image_points, block.cameras
    number, position = control.row_in_full(len(block.points)), block.positions_m
    use = usable & (number[points.point] >= 0) & np.isfinite(position[points.image]).all(axis=1)
    image, camera = points.image[use], block.images.camera[points.image[use]]
    variance = np.zeros(len(block.images))
    variance[block.exterior.image] = np.nan_to_num(np.einsum("nii->n", block.exterior.position_covariance_m2) / 3)
    observed = np.isin(image, block.exterior.image[block.exterior.position_use == OBSERVED_VALUE])
    return ControlRays(
        image,
        number[points.point[use]],
        xy_mm[use] - c.principal_point_mm[camera],
        c.principal_point_mm[camera],
        c.principal_distance_mm[camera],
        position,
        control.xyz_m,
        bool(len(image)) and bool(observed.mean() > 0.5),
        np.sqrt(np.maximum(variance, 0.0)),
        np.lexsort((block.ground_points.line[control.row], block.ground_points.file[control.row])),
    )


def photo_mm(block: Block) -> Float:
    """Image points in mm from the middle of the image, turned as it may be; NaN where they cannot be had."""
    c, points = block.cameras, block.image_points
    xy = np.full((len(points), 2), np.nan)
    camera = block.images.camera[points.image]
    centre = _middle_of_marks(block)
    for k in range(len(c)):
        of_camera = camera == k
        pixel = c.image_coordinates[k] == "pixel"
        if c.image_coordinates[k] == "photo":
            xy[of_camera] = points.xy[of_camera]
        elif pixel and c.kind[k] == "digital":
            matrix = mm_from_pixel(c.pixel_size_mm[k], str(c.pixel_origin[k]), str(c.pixel_y[k]), c.format[k])
            xy[of_camera] = points.xy[of_camera] @ matrix[:, :2].T + matrix[:, 2]
        else:
            xy[of_camera] = (points.xy[of_camera] - centre[points.image[of_camera]]) * (
                c.pixel_size_mm[k] if pixel else 1.0
            )
    return xy


def _middle_of_marks(block: Block) -> Float:
    """Middle of the fiducial marks of each film image, as measured; NaN where there are not four of them."""
    marks, n = block.fiducial_points, len(block.images)
    count = np.bincount(marks.image, minlength=n)
    total = np.stack([np.bincount(marks.image, weights=marks.xy[:, axis], minlength=n) for axis in range(2)], axis=1)
    return np.where(count[:, None] >= 4, total / np.maximum(count, 1)[:, None], np.nan)
