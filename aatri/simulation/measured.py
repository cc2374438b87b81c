"""What is observed: the truth put through the instruments, with noise and gross errors.

observation = truth + factor * sigma * N(0, 1) + gross error. The standard deviations stored are the a-priori ones,
whatever the factor. Each kind of observation has its own random stream, so that switching one off leaves the others as
they were.

A gross error is a random direction over the coordinates observed, times a size drawn evenly between two numbers of
standard deviations.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts import block as b
from aatri.errors import InputError
from aatri.ids import several
from aatri.simulation import film
from aatri.simulation.flight import FlightPlan
from aatri.simulation.settings import CameraOptions, GnssOptions, GrossErrorOptions, NoiseOptions, refused
from aatri.units import LENGTH_MM

Streams = Mapping[str, np.random.Generator]


def gross_errors(
    much: float, sigma: Float, size: tuple[float, float], rng: np.random.Generator, what: str
) -> tuple[Int, Float]:
    """Rows chosen and errors to add.

    Parameters
    ----------
    much : float
        A share of the rows if below 1, otherwise how many.
    sigma : (n, k) float64
        Standard deviations; 0 where a coordinate is not observed. Rows of zeros are never chosen.
    size : (float, float)
        Smallest and largest size in standard deviations.

    Returns
    -------
    rows : (m,) int64, ascending
    errors : (m, k) float64, unit of sigma

    Raises
    ------
    InputError
        If there are fewer observations than gross errors.
    """
    eligible = np.flatnonzero((sigma > 0).any(axis=1))
    count = round(much * len(eligible)) if much < 1 else int(much)
    if count > len(eligible):
        raise refused(
            f"{several(count, 'gross error')} among {len(eligible)} {what}", f"lower gross_errors.{what}", InputError
        )
    rows = np.sort(rng.choice(eligible, count, replace=False)) if count else np.zeros(0, np.int64)
    direction = rng.standard_normal((count, sigma.shape[1])) * (sigma[rows] > 0)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
    return rows, rng.uniform(*size, (count, 1)) * direction * sigma[rows]


@dataclass(frozen=True)
class Disturbance:
    """Noise, gross errors, and the random streams they come from."""

    noise: NoiseOptions
    gross: GrossErrorOptions
    streams: Streams

    def added(self, kind: str, what: str, sigma: Float, observed: Float | None = None) -> tuple[Float, tuple[Any, ...]]:
        """What is added to the truth, and the gross errors in it as (kind, rows, errors).

        `sigma` is (n, k); the optional mask of the same shape says which coordinates may get a gross error.
        """
        values = self.noise.factor * sigma * self.streams[kind].standard_normal(sigma.shape)
        open_to = sigma if observed is None else sigma * observed
        chosen, errors = gross_errors(
            getattr(self.gross, what), open_to, self.gross.size_sigmas, self.streams[f"gross_{kind}"], what
        )
        values[chosen] += errors
        return values, (kind, chosen, errors)


STREAMS = (
    "terrain",
    "flight",
    "points",
    "film",
    "image_point",
    "fiducial",
    "control",
    "position",
    "drift",
    "gross_image_point",
    "gross_fiducial",
    "gross_control",
    "gross_position",
    "attitude",
    "attitude_drift",
    "gross_attitude",
    "structure",
    "structure_error",
    "gross_structure",
    "survey",
    "survey_error",
    "gross_survey",
    "movement",
)
"""Names of the random streams; a new one goes to the end."""


def diagonal(sigma: Float) -> Float:
    """Covariance matrices (n, k, k) of standard deviations (n, k)."""
    return np.asarray((sigma * sigma)[:, :, None] * np.eye(sigma.shape[1]))


def image_points(
    image: Int,
    point: Int,
    photo_mm: Float,
    camera: CameraOptions,
    placement: tuple[Float, Float],
    disturbance: Disturbance,
) -> tuple[b.MeasuredPoints, tuple[Any, ...]]:
    """Image points as measured, in the given order."""
    sigma = np.full((len(image), 2), disturbance.noise.image_um * LENGTH_MM["um"])
    xy = film.comparator(photo_mm, image, placement) if camera.kind == "film" else film.pixels(photo_mm, camera)
    errors, gross = disturbance.added("image_point", "image_points", sigma / camera.mm_per_unit)
    return b.MeasuredPoints.of(image=image, point=point, xy=xy + errors, sigma_mm=sigma), gross


def fiducial_points(
    images: int, marks_mm: Float, placement: tuple[Float, Float], disturbance: Disturbance
) -> tuple[b.FiducialPoints, tuple[Any, ...]]:
    """Fiducial marks as measured in every image."""
    image = np.repeat(np.arange(images), len(marks_mm))
    fiducial = np.tile(np.arange(len(marks_mm)), images)
    sigma = np.full((len(image), 2), disturbance.noise.fiducial_um * LENGTH_MM["um"])
    errors, gross = disturbance.added("fiducial", "fiducials", sigma)
    xy = film.comparator(marks_mm[fiducial], image, placement) + errors
    return b.FiducialPoints.of(image=image, fiducial=fiducial, xy=xy, sigma_mm=sigma), gross


def ground_points(
    point: Int, xyz_m: Float, role: Int, disturbance: Disturbance
) -> tuple[b.GroundPoints, tuple[Any, ...]]:
    """Control and check points as surveyed; coordinates without a role are not given."""
    sigma = np.tile(np.array(disturbance.noise.control_m), (len(point), 1))
    errors, gross = disturbance.added("control", "control", sigma, role == b.CONTROL)
    xyz_m = np.where(role == b.NO_ROLE, np.nan, xyz_m + errors)
    return b.GroundPoints.of(point=point, xyz_m=xyz_m, covariance_m2=diagonal(sigma), role=role), gross


def exterior(
    true_m: Float, planned_m: Float, plan: FlightPlan, order: Int, gnss: GnssOptions, disturbance: Disturbance
) -> tuple[b.Exterior, tuple[Any, ...]]:
    """Positions: observed, of the flight plan, or none. Row k is that of image k, station `order[k]` of the plan."""
    n = len(true_m) if gnss.observed or gnss.approximate_positions else 0
    sigma = np.tile(np.array(disturbance.noise.gnss_m), (n, 1))
    gross: tuple[Any, ...] = ("position", np.zeros(0, np.int64), np.zeros((0, 3)))
    position, covariance = planned_m[:n], np.full((n, 3, 3), np.nan)
    drifting = gnss.observed and (gnss.shift_m > 0 or gnss.drift_m_per_s > 0)
    if gnss.observed:
        errors, gross = disturbance.added("position", "positions", sigma)
        drift = drift_of_strips(plan, gnss.shift_m, gnss.drift_m_per_s, disturbance.streams["drift"])[order]
        position, covariance = true_m + errors + drift, diagonal(sigma)
    table = b.Exterior.of(
        image=np.arange(n),
        position_m=position,
        position_covariance_m2=covariance,
        position_use=b.OBSERVED_VALUE if gnss.observed else b.APPROXIMATE_VALUE,
        refers_to=b.ANTENNA if gnss.observed and any(gnss.lever_arm_m) else b.PROJECTION_CENTRE,
        drift_group=np.array(plan.strip)[order][:n] if drifting else "",
    )
    return table, gross


def drift_of_strips(plan: FlightPlan, shift: float, drift: float, rng: np.random.Generator) -> Float:
    """Shift and drift per second of each station, common to its strip: (n, 3), in the unit of both sigmas."""
    _, first, strip = np.unique(plan.strip, return_index=True, return_inverse=True)
    level, rate = rng.standard_normal((2, len(first), 3)) * np.array([shift, drift])[:, None, None]
    middle = np.bincount(strip, plan.time_s) / np.bincount(strip)
    return np.asarray(level[strip] + rate[strip] * (plan.time_s - middle[strip])[:, None])
