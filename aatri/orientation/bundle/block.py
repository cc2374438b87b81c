"""What a bundle adjustment takes: rays, start values, control, positions, further parameters; and what can take part.

Points with too few rays and images with too few points are left out before the first iteration, and named.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.unknowns import Ids
from aatri.arrays import Bool, Float, Int
from aatri.geometry.vectors import finite_rows
from aatri.observations.control import Control
from aatri.observations.positions import Positions
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.bundle.strip_numbering import StripNumbering

MIN_IMAGE_POINTS = 3


@dataclass(frozen=True)
class ParameterRows:
    """A group of unknown parameters of images or cameras, beside the poses.

    Attributes
    ----------
    group : str
        FILM, ADDITIONAL or CAMERA.
    ids : (n,) str
        Names of the blocks.
    labels : tuple of str
        Names of the s parameters of a block.
    start : (n, s) float64
    free : (n, s) bool
    prior : (n, s) float64
        Observed values of the weighted parameters.
    covariance : (n, s, s) float64
        Their covariance.
    weighted : (n, s) bool
    block : (n_rays,) int
        Block of each ray.
    basis : (n_rays, 2, s) float64 or None
        Correction of the measured coordinate per parameter; None where `model` tells the equations.
    model : tuple of str
        Camera model of each block, for CAMERA.
    per_image : bool
        The blocks are those of the images, one by one.
    """

    group: str
    ids: Ids
    labels: tuple[str, ...]
    start: Float
    free: Bool
    prior: Float
    covariance: Float
    weighted: Bool
    block: Int
    basis: Float | None = None
    model: tuple[str, ...] = ()
    per_image: bool = False

    def take(self, rays: Bool) -> ParameterRows:
        """With the chosen rays only."""
        return replace(self, block=self.block[rays], basis=None if self.basis is None else self.basis[rays])


@dataclass(frozen=True)
class BundleInput:
    """A block ready for adjustment: rows are those of all images and points.

    Attributes
    ----------
    image_ids, point_ids : str
    rays : ImagePointRows
    poses : Poses
        Start; NaN where unknown.
    xyz_m : (n_points, 3) float64, m
        Start; NaN where unknown.
    control : Control
    positions : Positions
    parameters : tuple of ParameterRows
        In the order FILM, ADDITIONAL, CAMERA.
    marked : (n_points,) bool, optional
        Points on which a free datum may rest.
    numbering : StripNumbering, optional
        Places of the images for the textbook's orders of elimination; else their positions.
    """

    image_ids: Ids
    point_ids: Ids
    rays: ImagePointRows
    poses: Poses
    xyz_m: Float
    control: Control
    positions: Positions
    parameters: tuple[ParameterRows, ...] = ()
    marked: Bool | None = None
    numbering: StripNumbering | None = None


def determinable(given: BundleInput) -> tuple[Bool, Bool, Bool]:
    """Which rays, images and points can take part: start values known, enough rays each, repeated until stable.

    Returns
    -------
    ray, image, point : bool arrays
    """
    rays, n_images, n_points = given.rays, len(given.image_ids), len(given.point_ids)
    image = finite_rows(given.poses.position_m) & finite_rows(given.poses.ground_from_image)
    point = finite_rows(given.xyz_m)
    control = np.zeros(n_points, dtype=np.int64)
    np.add.at(control, given.control.point, given.control.given.sum(axis=1))
    positioned = np.bincount(given.positions.image, minlength=n_images) > 0
    while True:
        ray = rays.active & image[rays.image] & point[rays.point]
        per_point = np.bincount(rays.point[ray], minlength=n_points)
        per_image = np.bincount(rays.image[ray], minlength=n_images)
        enough_points = (per_image >= MIN_IMAGE_POINTS) | (positioned & (per_image >= MIN_IMAGE_POINTS - 1))
        enough_rays = (per_point >= 2) | ((per_point >= 1) & (control > 0))
        if not (image & ~enough_points).any() and not (point & ~enough_rays).any():
            return ray, image, point
        image, point = image & enough_points, point & enough_rays
