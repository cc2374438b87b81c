"""Unknown parameters of images: what fiducial marks leave open of their film, and their motion while rows are read out.

The interior orientation passes the errors of the marks on, as the numbers d of a correction K(x, y) d of the measured
coordinates (`geometry.plane_transformations`): an error that all points of an image have in common. The bundle carries
them as unknowns, relative orientation counts them.
"""

from dataclasses import replace

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints, Interior
from aatri.errors import InputError
from aatri.ids import shown
from aatri.notes import Note
from aatri.observations.image_points import film_correction, rays_of
from aatri.observations.observed import ObservationSource
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import FILM, POINT, POSE
from aatri.observations.rolling_shutter import ROLLING, VELOCITY, by_velocity, flown_velocities


def film_parameters(block: Block, image_points: ImagePoints) -> ParameterRows | None:
    """The film corrections d that the fiducials leave open, weighted by their interior orientation, mm and 1.

    None where no image has measured fiducials: pixels are where they are. The covariance is zero where an image has no
    open film.

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
    open_, covariance, zero = open_[:, :size], covariance[:, :size, :size], np.zeros((n, size))
    of_ray, weighted = image_points.measurements.image, (zero, covariance, open_)
    return ParameterRows(FILM, block.images.id, labels, zero, open_, *weighted, of_ray, basis, per_image=True)


def _linear_part(block: Block, interior: Interior) -> Float:
    """Of the transformations, from nominal millimetres: the axes of the measurement."""
    size = block.cameras.pixel_size_mm[block.images.camera[interior.image]]
    pixel = (block.cameras.image_coordinates == "pixel")[block.images.camera[interior.image]]
    return np.asarray(interior.matrix[:, :, :2] / np.where(pixel[:, None], size, 1.0)[:, None, :])


def with_row_times(
    source: ObservationSource, sigma: float | None, velocity_sigma_m_s: float | None = 0.0
) -> ObservationSource:
    """The block with the motion of its cameras while rows are read out, where image points say when they were.

    Parameters
    ----------
    sigma : float, optional
        Standard deviation of the readout of a camera as a share of that of the row times: 0 as they say, None free.
    velocity_sigma_m_s : float, optional
        Standard deviation of the velocities that neighbours say: 0 as they say, None free for each image.

    Raises
    ------
    InputError
        If images with row times have no time, or no other image of their camera and flight.
    """
    block, points = source.block, source.image_points
    if points is None or not np.isfinite(block.image_points.row_time_s).any():
        chosen = [n for n, value in (("readout_sigma", sigma), ("velocity_sigma", velocity_sigma_m_s)) if value != 0]
        text = f"{', '.join(chosen)}: options are set, but no image point has a row time"
        return replace(source, notes=(*source.notes, Note("warning", text))) if chosen else source
    rays, poses = rays_of(block, points), source.start[POSE]
    row_time_s = block.image_points.row_time_s
    images = block.images
    track = np.unique(np.char.add(np.char.add(images.flight, "/"), images.camera.astype(str)), return_inverse=True)[1]
    velocity = flown_velocities(images.time_s, track.ravel(), poses.position_m)
    still = np.isin(np.arange(len(images)), rays.image[np.isfinite(row_time_s) & rays.active])
    still &= ~np.isfinite(velocity).all(axis=1) & poses.oriented
    if still.any():
        raise InputError(
            f"row_time: no velocity for images {shown(images.id[still].tolist())}: they need a time, and another image "
            "of their camera and flight at another time",
            where="images.csv",
            remedy="give `time` in images.csv, or leave out row_time in image_points.csv",
        )
    basis = by_velocity(rays, poses, source.start[POINT], row_time_s)
    along = np.einsum("nij,nj->ni", basis, np.nan_to_num(velocity)[rays.image])[:, :, None]
    camera = images.camera[rays.image]
    rows = [_weighted(ROLLING, block.cameras.id, ("readout",), 1.0, sigma, camera, along)]
    if velocity_sigma_m_s != 0:
        further = _weighted(VELOCITY, images.id, ("vx", "vy", "vz"), 0.0, velocity_sigma_m_s, rays.image, basis)
        rows.append(replace(further, per_image=True))
    return replace(source, parameters=(*source.parameters, *rows))


def _weighted(
    group: str, ids: Text, labels: tuple[str, ...], value: float, sigma: float | None, block: Int, basis: Float
) -> ParameterRows:
    """Parameters of one observed value, all of one standard deviation: 0 known, None free."""
    n, k = len(ids), len(labels)
    values = np.full((n, k), value)
    covariance = np.tile((sigma or 1.0) ** 2 * np.eye(k), (n, 1, 1))
    weighted = np.full((n, k), bool(sigma))
    return ParameterRows(
        group, ids, labels, values, np.full((n, k), sigma != 0), values, covariance, weighted, block, basis
    )
