"""What fiducial marks leave open of the film of every image: an error that all points of an image have in common.

The interior orientation passes the errors of the marks on, as the numbers d of a correction K(x, y) d of the measured
coordinates (`geometry.plane_transformations`). The bundle carries them as unknowns, relative orientation counts them.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints, Interior
from aatri.observations.image_points import film_correction, rays_of
from aatri.observations.poses import FILM


@dataclass(frozen=True)
class FilmErrors:
    """Common errors of the film of every image."""

    labels: tuple[str, ...]
    """Of the numbers d."""
    basis: Float
    """(n, 2, s). K of every measurement."""
    covariance: Float
    """(n_images, s, s), mm and 1. Of d; zero where an image has no open film."""
    open: Bool
    """(n_images, s)."""


def film_errors(block: Block, image_points: ImagePoints) -> FilmErrors | None:
    """Of all images; None where no image has measured fiducials: pixels are where they are.

    Parameters
    ----------
    image_points : ImagePoints
        With their interior orientation.
    """
    n, interior = len(block.images), image_points.interior
    covariance = np.zeros((n, *interior.covariance.shape[1:]))
    covariance[interior.image] = interior.covariance
    open_ = np.einsum("nii->ni", covariance) > 0
    if not open_.any():
        return None
    size = int(np.flatnonzero(open_.any(axis=0)).max()) + 1
    model: Text = np.full(n, "affine", dtype=interior.model.dtype)
    linear = np.tile(np.eye(2), (n, 1, 1))
    model[interior.image], linear[interior.image] = interior.model, _linear_part(block, interior)
    basis = film_correction(rays_of(block, image_points), FILM, model, linear, size).basis
    labels = tuple(f"film correction d{k}" for k in range(size))
    return FilmErrors(labels, basis, covariance[:, :size, :size], open_[:, :size])


def _linear_part(block: Block, interior: Interior) -> Float:
    """Of the transformations, from nominal millimetres: the axes of the measurement."""
    size = block.cameras.pixel_size_mm[block.images.camera[interior.image]]
    pixel = (block.cameras.image_coordinates == "pixel")[block.images.camera[interior.image]]
    return np.asarray(interior.matrix[:, :, :2] / np.where(pixel[:, None], size, 1.0)[:, None, :])
