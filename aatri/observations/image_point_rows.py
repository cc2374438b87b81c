"""Rows of measured image points, and linear corrections of them."""

from __future__ import annotations

from dataclasses import dataclass

from aatri.arrays import Bool, Float, Int


@dataclass(frozen=True)
class ImagePointRows:
    """Measured image points.

    Attributes
    ----------
    image, point : (n,) int32
        Blocks of unknowns.
    xy_mm : (n, 2) float64, mm, from the principal point
    sigma_mm : (n, 2) float64, mm
    c_mm : (n,) float64, mm
        Principal distance of each ray's camera.
    principal_point_mm : (n, 2) float64, mm
        Of each ray's camera, from the fiducial centre.
    active : (n,) bool
    """

    image: Int
    point: Int
    xy_mm: Float
    sigma_mm: Float
    c_mm: Float
    principal_point_mm: Float
    active: Bool

    def take(self, rows: Int | Bool) -> ImagePointRows:
        """The chosen rows."""
        return ImagePointRows(*(getattr(self, column)[rows] for column in self.__dataclass_fields__))


@dataclass(frozen=True)
class LinearCorrection:
    """A correction added to the measured coordinates, linear in a group of unknowns.

    Attributes
    ----------
    group : str
    block : (n,) int
        Block of the group for each ray.
    basis : (n, 2, s) float64
        K, correction per parameter.
    """

    group: str
    block: Int
    basis: Float

    def take(self, rows: Int | Bool) -> LinearCorrection:
        """The chosen rows."""
        return LinearCorrection(self.group, self.block[rows], self.basis[rows])
