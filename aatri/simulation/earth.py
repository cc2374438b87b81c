"""The earth under the block and its terrain: flat, or a sphere seen in a Cartesian tangent frame or in a map.

The block is laid out in local coordinates (E, N, h): plane coordinates about the block's centre and height above sea
level. On a flat earth they are Cartesian. On the sphere of radius R = `units.EARTH_RADIUS_M` they belong to the
stereographic projection about the centre, which is conformal and of scale 1 there: with a = E / 2R, b = N / 2R and
q = a^2 + b^2 the direction of the vertical is

    u = (2a, 2b, 1 - q) / (1 + q)

and the point is P = (R + h) u - (0, 0, R) in the tangent frame: Cartesian, origin at sea level below the block's
centre, axes east, north and up there. So the height of any point of the tangent frame is exactly

    h = sqrt(X^2 + Y^2 + (R + Z)^2) - R;

whoever corrects for refraction in a tangent frame uses this same definition. East, north and up *of a place* are the
directions in which E, N and h grow; they are orthogonal, the map being conformal. Source: closed forms of the sphere.

The terrain: a sum of plane waves with random directions and phases,

    z(E, N) = mean + relief / n * sum_k cos(w_k . (E, N) + f_k),

so that heights stay within mean +- relief. Wavelengths run from the shortest one to four times that.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.units import EARTH_RADIUS_M

WAVES = 6


def tangent_from_map(local_m: Float) -> Float:
    """Tangent-frame coordinates of local map coordinates.

    Parameters
    ----------
    local_m : (n, 3) float64, m, (E, N, h)

    Returns
    -------
    (n, 3) float64, m
    """
    R = EARTH_RADIUS_M
    a, b, h = local_m[:, 0] / (2 * R), local_m[:, 1] / (2 * R), local_m[:, 2]
    q = a * a + b * b
    z = (h * (1 - q) - 2 * q * R) / (1 + q)  # (R + h) (1 - q) / (1 + q) - R without its cancellation
    return np.stack([2 * a * (R + h) / (1 + q), 2 * b * (R + h) / (1 + q), z], axis=1)


def map_from_tangent(tangent_m: Float) -> Float:
    """Local map coordinates (E, N, h) of places of the tangent frame: the inverse of `tangent_from_map`."""
    R = EARTH_RADIUS_M
    from_centre = tangent_m + np.array([0.0, 0.0, R])
    distance = np.linalg.norm(from_centre, axis=1)
    s = (tangent_m**2).sum(axis=1) + 2.0 * R * tangent_m[:, 2]
    stretch = 2 * R / (from_centre[:, 2] + distance)
    return np.stack([tangent_m[:, 0] * stretch, tangent_m[:, 1] * stretch, s / (distance + R)], axis=1)


def tangent_from_place(local_m: Float) -> Float:
    """Rotation from the axes of each place (its east, north, up) to those of the tangent frame.

    Parameters
    ----------
    local_m : (n, 3) float64, m, (E, N, h)

    Returns
    -------
    (n, 3, 3) float64
    """
    a, b = local_m[:, 0] / (2 * EARTH_RADIUS_M), local_m[:, 1] / (2 * EARTH_RADIUS_M)
    q = a * a + b * b
    east = np.stack([1 + b * b - a * a, -2 * a * b, -2 * a], axis=1)
    north = np.stack([-2 * a * b, 1 + a * a - b * b, -2 * b], axis=1)
    up = np.stack([2 * a, 2 * b, 1 - q], axis=1)
    return np.stack([east, north, up], axis=2) / (1 + q)[:, None, None]


def settled(local_m: Float, false_origin_m: tuple[float, float]) -> Float:
    """Local coordinates that differ from the given ones by rounding only and to which the false origin adds exactly."""
    origin = np.array([*false_origin_m, 0.0])
    return np.asarray((local_m + origin) - origin)


@dataclass(frozen=True)
class Surface:
    """Heights as a function of the plan position."""

    mean_m: float
    amplitude_m: float
    waves_rad_per_m: Float
    phases_rad: Float

    def height_m(self, plan_m: Float) -> Float:
        """Height above sea level at (n, 2) plan positions, m."""
        height = np.full(len(plan_m), self.mean_m)
        for wave, phase in zip(self.waves_rad_per_m, self.phases_rad):
            height += self.amplitude_m * np.cos(plan_m @ wave + phase)
        return height


def random_surface(mean_m: float, relief_m: float, wavelength_m: float, rng: np.random.Generator) -> Surface:
    """A surface with heights within mean +- relief, m."""
    direction = rng.uniform(0.0, 2 * np.pi, WAVES)
    length = wavelength_m * 4.0 ** rng.uniform(0.0, 1.0, WAVES)
    waves = 2 * np.pi / length[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    return Surface(mean_m, relief_m / WAVES, waves, rng.uniform(0.0, 2 * np.pi, WAVES))
