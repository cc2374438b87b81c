"""Rows of measured image points, and linear corrections of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.observations.poses import Poses


@dataclass(frozen=True)
class ImagePointRows:
    """Measured image points."""

    image: Int
    point: Int
    """(n,) int32. Blocks of unknowns."""
    xy_mm: Float
    """(n, 2), mm, from the principal point."""
    sigma_mm: Float
    """(n, 2), mm."""
    c_mm: Float
    """(n,), mm. Principal distance of each ray's camera."""
    principal_point_mm: Float
    """(n, 2), mm. Of each ray's camera, from the fiducial centre."""
    active: Bool
    """(n,)."""

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of directions in the middle of images, the median as stated; 0 without image points."""
        return float(np.median(self.sigma_mm.mean(axis=1) / self.c_mm)) if len(self.c_mm) else 0.0

    def directions(self, poses: Poses, rows: Int | Bool) -> Float:
        """Where rays go on the ground from their images, (k, 3), mm long."""
        in_image = np.column_stack([self.xy_mm[rows], -self.c_mm[rows]])
        return np.asarray(np.einsum("nij,nj->ni", poses.ground_from_image[self.image[rows]], in_image))

    def take(self, rows: Int | Bool) -> ImagePointRows:
        """The chosen rows."""
        return ImagePointRows(*(getattr(self, column)[rows] for column in self.__dataclass_fields__))


@dataclass(frozen=True)
class LinearCorrection:
    """A correction added to the measured coordinates, linear in a group of unknowns."""

    group: str
    block: Int
    """(n,). Block of the group for each ray."""
    basis: Float
    """(n, 2, s). K, correction per parameter."""

    def take(self, rows: Int | Bool) -> LinearCorrection:
        """The chosen rows."""
        return LinearCorrection(self.group, self.block[rows], self.basis[rows])


def residuals_mm(rays: ImagePointRows, rows: Int, poses: Poses, xyz: Float) -> Float:
    """Distance of image points from where their point is seen, mm; inf behind the image, NaN without a point."""
    image, point = rays.image[rows], rays.point[rows]
    w = xyz[point] - poses.position_m[image]
    u = np.einsum("nji,nj->ni", poses.ground_from_image[image], w)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = -rays.c_mm[rows, None] * u[:, :2] / u[:, 2:] - rays.xy_mm[rows]
    return np.asarray(np.where(u[:, 2] >= 0, np.inf, np.linalg.norm(v, axis=1)))
