"""Interior orientation of a block by fiducial marks, with any of the plane transformations: what the variants share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.interior.film_checks import check_film, film_suspects
from aatri.adapters.interior.film_marks import film_images, film_marks, film_residuals, with_film_transformations
from aatri.adapters.interior.photo_coordinates import Transformations, calibrated_transformations, image_points_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.geometry.plane_transformations import plane_jacobian, transform_plane
from aatri.notes import Note
from aatri.orientation.interior.fiducial_fit import snooped_fiducials
from aatri.orientation.interior.film_deformation import turn_rad


def film_orientation(
    block: Block, model: str, test_limit: float, max_sigma0: float
) -> tuple[ImagePoints, tuple[Note, ...]]:
    """Photo coordinates of film by fiducial marks; of other images by calibration.

    Parameters
    ----------
    model : str
        One of `geometry.plane_transformations.PARAMETERS`.
    test_limit : float
        A mark with a larger test statistic is rejected.
    max_sigma0 : float
        An image whose sigma0 is larger is not used.
    """
    film = film_images(block)
    others = np.flatnonzero(block.images.active & ~film)
    transformations = calibrated_transformations(block, others)
    none = "no film image with comparator or pixel coordinates: no fiducial marks are needed"
    notes = () if film.any() else (Note("note", none),)
    marks = film_marks(block, np.flatnonzero(film))
    size = np.einsum("nii->ni", marks.nominal)
    fit = snooped_fiducials(model, marks.measured, marks.calibrated_mm, marks.sigma_mm, marks.present, size,
                            limit=test_limit)  # fmt: skip
    usable, told = check_film(block, marks, fit, max_sigma0)
    fit = replace(fit, determined=usable)
    transformations = with_film_transformations(transformations, marks, fit)
    rigid = None
    if film.any():
        rigid = np.full((len(block.images), 2, 3), np.nan)
        linear = fit.photo_from_nominal[usable]
        rigid[marks.image[usable]] = _turned_only(transformations, marks.image[usable], linear, size[usable])
    made, also = image_points_of(
        block,
        transformations,
        fiducial_residuals=film_residuals(block, marks, fit),
        suspects=film_suspects(block, marks, fit),
        film_deformation=rigid,
    )
    return made, (*notes, *told, *also)


def _turned_only(transformations: Transformations, images: Int, linear: Float, size: Float) -> Float:
    """Transformations (n, 2, 3) that only turn, at nominal scale, and agree at the fiducial centre."""
    model = str(transformations.model[images[0]]) if len(images) else "affine"
    matrix, terms = transformations.matrix[images], transformations.terms[images]
    centre = np.zeros((len(images), 1, 2))
    centre[:, 0] = np.linalg.solve(matrix[:, :, :2], -matrix[:, :, 2:])[:, :, 0]
    for _ in range(5):
        J = plane_jacobian(model, matrix, terms, centre)[:, 0]
        miss = transform_plane(model, matrix, terms, centre)[:, 0]
        centre[:, 0] -= np.linalg.solve(J, miss[:, :, None])[:, :, 0]
    angle = turn_rad(linear)
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2) * size[:, None, :]
    return np.concatenate([turned, -turned @ centre.swapaxes(1, 2)], axis=2)
