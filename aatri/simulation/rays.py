"""Which points appear in which images, and where.

For every image a k-d tree of the points gives those within the reach of its corners at the largest tilt; they are put
through the forward model, and those that fall inside the format, less its margin, are its image points. Images are
taken in chunks, so that memory stays small for any size of block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from aatri.adjustment.threads import in_threads
from aatri.arrays import Float, Int
from aatri.simulation import earth, forward
from aatri.simulation.geodetic import GeodeticEarth
from aatri.simulation.settings import CameraOptions
from aatri.units import EARTH_RADIUS_M

CHUNK = 256
"""Images at a time."""


@dataclass(frozen=True)
class Photography:
    """All that decides where a point is imaged."""

    camera: CameraOptions
    spherical: bool
    refraction: str  # none, radial, vertical_plane
    terrain_height_m: float
    station_m: Float  # (n, 3) E, N, h
    rotation: Float  # (n, 3, 3) to the axes of the station
    geodetic: GeodeticEarth | None = None  # an ellipsoid with its map, instead of flat or sphere

    def cartesian(self, local_m: Float) -> Float:
        """Cartesian coordinates of local (E, N, h)."""
        return self.geodetic.cartesian(local_m) if self.geodetic else cartesian(local_m, self.spherical)

    def moved(self, arm_m: tuple[float, float, float]) -> Float:
        """Local (E, N, h) of what is displaced from the stations by an arm in camera axes."""
        if not any(arm_m):
            return self.station_m
        return self.local(self.cartesian(self.station_m) + self.cartesian_rotations() @ np.array(arm_m))

    def local(self, cartesian_m: Float) -> Float:
        """Local (E, N, h) of Cartesian coordinates: the inverse of `cartesian`."""
        if self.geodetic:
            return self.geodetic.local(cartesian_m)
        return earth.map_from_tangent(cartesian_m) if self.spherical else cartesian_m

    def axes(self, local_m: Float) -> Float:
        """East, north and up of places in the Cartesian frame, (n, 3, 3), columns."""
        if self.geodetic:
            return self.geodetic.axes(local_m)
        return cartesian_rotation(local_m, np.broadcast_to(np.eye(3), (len(local_m), 3, 3)), self.spherical)

    def convergence_rad(self) -> Float:
        """Grid north from true north at the stations, clockwise, rad."""
        return self.geodetic.convergence_rad(self.station_m) if self.geodetic else np.zeros(len(self.station_m))

    def on_ellipsoid(self, start_m: Float, end_m: Float) -> Float:
        """Lengths on the earth's surface between places (E, N, h), m: of the geodesic, the great circle, the line."""
        if self.geodetic:
            return self.geodetic.on_ellipsoid(start_m, end_m)
        level = np.array([1.0, 1.0, 0.0])
        chord = np.linalg.norm(self.cartesian(end_m * level) - self.cartesian(start_m * level), axis=1)
        return np.asarray(2 * EARTH_RADIUS_M * np.arcsin(0.5 * chord / EARTH_RADIUS_M) if self.spherical else chord)

    def cartesian_rotations(self) -> Float:
        """Rotations of the stations to the Cartesian frame."""
        if self.geodetic:
            return np.asarray(self.geodetic.axes(self.station_m) @ self.rotation)
        return cartesian_rotation(self.station_m, self.rotation, self.spherical)


@dataclass(frozen=True)
class SimulatedRays:
    """Image points: rows of images and points, and photo coordinates."""

    image: Int
    point: Int
    photo_mm: Float

    def of_points(self, number: Int) -> SimulatedRays:
        """The rays of the points whose new number is not negative, with that number."""
        kept = number[self.point] >= 0
        return SimulatedRays(self.image[kept], number[self.point[kept]], self.photo_mm[kept])


def cartesian(local_m: Float, spherical: bool) -> Float:
    """Cartesian coordinates of local (E, N, h)."""
    return earth.tangent_from_map(local_m) if spherical else local_m


def cartesian_rotation(station_m: Float, rotation: Float, spherical: bool) -> Float:
    """Rotations to the Cartesian frame from rotations to the axes of the stations."""
    return np.asarray(earth.tangent_from_place(station_m) @ rotation) if spherical else rotation


def taken(photography: Photography, local_m: Float) -> SimulatedRays:
    """All rays from the points, given as (n, 3) local E, N, h, to the images in which they fall."""
    if not len(local_m):
        return SimulatedRays(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)))
    points_m = photography.cartesian(local_m)
    tree = cKDTree(local_m[:, :2])
    reach = _reach_m(photography, float(local_m[:, 2].min()))
    stations_m, rotations = photography.cartesian(photography.station_m), photography.cartesian_rotations()
    parts: dict[int, SimulatedRays] = {}

    def chunks(first: int, last: int) -> None:
        for k in range(first, last):
            stations = slice(k * CHUNK, (k + 1) * CHUNK)
            near = tree.query_ball_point(photography.station_m[stations, :2], reach, return_sorted=True)
            image = k * CHUNK + np.repeat(np.arange(len(near)), [len(n) for n in near])
            point = np.concatenate([np.asarray(n, dtype=np.int64) for n in near])
            u = forward.camera_frame(points_m[point], stations_m[image], rotations[image])
            parts[k] = _imaged(photography, image, point, u)

    in_threads(-(-len(stations_m) // CHUNK), chunks, worth=1)
    return SimulatedRays(
        *(np.concatenate([getattr(parts[k], name) for k in sorted(parts)]) for name in ("image", "point", "photo_mm"))
    )


def _reach_m(photography: Photography, lowest_m: float) -> float:
    camera = photography.camera
    corner = np.arctan(np.hypot(*camera.half_format_mm) / camera.principal_distance_mm)
    tilt = np.arccos(np.clip(photography.rotation[:, 2, 2].min(), -1.0, 1.0))
    height = photography.station_m[:, 2].max() - lowest_m
    return float(height * np.tan(min(corner + tilt, np.deg2rad(80.0))))


def _imaged(photography: Photography, image: Int, point: Int, u: Float) -> SimulatedRays:
    camera, c = photography.camera, photography.camera.principal_distance_mm
    station_m = photography.station_m
    half = np.array(camera.half_format_mm)
    near = (u[:, 2] < 0) & (np.abs(u[:, :2]) * c <= -1.1 * half * u[:, 2:] + 1.0).all(axis=1)
    image, point, u = image[near], point[near], u[near]
    K = forward.refraction_constant_rad(1e-3 * station_m[image, 2], 1e-3 * photography.terrain_height_m)
    if photography.refraction == "vertical_plane":
        upright = np.einsum("nij,nj->ni", photography.rotation[image], u)
        bent = forward.refracted_in_vertical_plane(upright, K)
        xy = forward.ideal(forward.camera_frame(bent, np.zeros(3), photography.rotation[image]), c)
    else:
        xy = forward.ideal(u, c)
        if photography.refraction == "radial":
            xy = forward.refracted_radially(xy, K, c)
    photo = forward.through_lens(xy, camera) + camera.principal_point_mm
    inside = (np.abs(photo) <= half - camera.margin_mm).all(axis=1)
    return SimulatedRays(image[inside], point[inside], photo[inside])
