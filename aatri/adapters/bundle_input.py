"""From artifacts to a bundle adjustment: rays, start values, control, positions."""

from __future__ import annotations

import numpy as np

from aatri.observations.control import Control
from aatri.observations.positions import Positions
from aatri.adapters.orientations import given_orientations
from aatri.arrays import Float
from aatri.artifacts.block import CHECK, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.geometry.vectors import finite_rows
from aatri.observations.image_points import ImagePointRows, film_correction
from aatri.observations.poses import FILM, Poses
from aatri.orientation.bundle.block import BundleInput, ParameterRows
from aatri.orientation.bundle.complete_start import complete_start
from aatri.orientation.bundle.strip_numbering import strip_numbering


def rays_of(block: Block, image_points: ImagePoints) -> ImagePointRows:
    """All measurements as rays; those without coordinates are inactive."""
    m = image_points.measurements
    camera = block.images.camera[m.image]
    return ImagePointRows(
        m.image,
        m.point,
        m.xy_mm,
        m.sigma_mm,
        block.cameras.principal_distance_mm[camera],
        block.cameras.principal_point_mm[camera],
        m.active & finite_rows(m.xy_mm),
    )


def bundle_input(
    block: Block, image_points: ImagePoints, initial: Solution | None, control: Control, positions: Positions,
    parameters: tuple[ParameterRows, ...] = (),
) -> BundleInput:  # fmt: skip
    """A block ready for adjustment; missing start values are filled in by intersection and resection.

    Raises
    ------
    GeometryError
        If no image has a starting orientation.
    """
    rays = rays_of(block, image_points)
    poses, xyz = complete_start(rays, _start_poses(block, initial), _start_points(block, initial))
    numbering = strip_numbering(poses.position_m, block.images.strip, block.images.sequence)
    return BundleInput(
        block.images.id,
        block.points.id,
        rays,
        poses,
        xyz,
        control,
        positions,
        parameters,
        marked=np.isin(np.arange(len(block.points)), block.ground_points.point[block.ground_points.datum]),
        numbering=numbering,
    )


def film_parameters(block: Block, image_points: ImagePoints) -> ParameterRows | None:
    """The film corrections that the fiducials leave open, weighted by their interior orientation.

    None where no image has measured fiducials: pixels are where they are.
    """
    n = len(block.images)
    covariance = np.zeros((n, 6, 6))
    covariance[image_points.interior.image] = image_points.interior.covariance
    open_ = (np.einsum("nii->ni", covariance) > 0).all(axis=1)
    if not open_.any():
        return None
    free = np.repeat(open_[:, None], 6, axis=1)
    rays = rays_of(block, image_points)
    labels = tuple(f"film correction d{k}" for k in range(6))
    zero = np.zeros((n, 6))
    return ParameterRows(FILM, block.images.id, labels, zero, free, zero, covariance, free, rays.image,
                         film_correction(rays, FILM).basis, per_image=True)  # fmt: skip


def _start_poses(block: Block, initial: Solution | None) -> Poses:
    if initial is not None:
        return Poses(initial.images.position_m, initial.images.ground_from_image)
    position, rotation = given_orientations(block)
    if not (finite_rows(position) & finite_rows(rotation)).any():
        raise GeometryError(
            "no image has a starting orientation",
            where=f"block {block.name}",
            remedy="give `initial` in `from:`, or positions and angles in exterior.csv",
        )
    return Poses(position, rotation)


def _start_points(block: Block, initial: Solution | None) -> Float:
    if initial is not None:
        return initial.points.xyz_m
    xyz = np.full((len(block.points), 3), np.nan)
    xyz[block.ground_points.point] = np.where(block.ground_points.role == CHECK, np.nan, block.ground_points.xyz_m)
    return xyz
