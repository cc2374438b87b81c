"""A little simulator of image pairs: collinearity, nothing of the code under test."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.intersection import Intersection
from aatri.orientation.relative.orientations import PER_PAIR, PER_POINT
from aatri.orientation.relative.pairs import relative_orientations

C_MM = 153.84


def image_coordinates(X, X0, R, c=C_MM):
    """x, y in mm of points X seen from X0 with X - X0 = lambda R (x, y, -c)."""
    u = (X - X0) @ R
    return -c * u[:, :2] / u[:, 2:]


def gruber_ground(per_place=1, rng=None, relief=0.0, b=0.6):
    """Points at the six Gruber positions of a model with base b and flying height 1; or spread around them."""
    places = np.array([[x, y, -1.0] for x in (0.0, b) for y in (0.0, 0.65, -0.65)])
    X = np.repeat(places, per_place, axis=0)
    if rng is not None:
        X = X + np.column_stack([rng.uniform(-0.1, 0.1, (len(X), 2)), rng.uniform(-relief, relief, len(X))])
    return X


def ray_directions(xy_mm, c_mm):
    """Directions (x, y, -c) of image points."""
    return np.column_stack([xy_mm, np.full(len(xy_mm), -c_mm)])


def rays_of(left, right, sigma=0.005, c=C_MM):
    """Rays of image coordinates with one standard deviation."""
    s = np.full((len(left), 2), sigma)
    z = np.full(len(left), -c)
    return RayPairs(np.column_stack([left, z]), np.column_stack([right, z]), s, s)


def simulate(X, R1, R2, X1, X2, rng=None, sigma=0.005):
    """Rays of a pair, and its true left_from_right and base."""
    left, right = image_coordinates(X, X1, R1), image_coordinates(X, X2, R2)
    if rng is not None:
        left = left + rng.normal(0, sigma, left.shape)
        right = right + rng.normal(0, sigma, right.shape)
    b = R1.T @ (X2 - X1)
    return rays_of(left, right, sigma), R1.T @ R2, b / np.linalg.norm(b)


def rotation(rng: np.random.Generator, spread=0.03, kappa=0.0):
    """Near-vertical rotation with tilts of the given spread and a kappa."""
    return Rotation.from_rotvec(rng.normal(size=3) * spread).as_matrix() @ Rotation.from_euler("z", kappa).as_matrix()


def relative_orientation(rays, snooping_limit=4.0, **settings):
    """One pair alone, by the compiled loops: its rows of `RelativeOrientations`, or a GeometryError with the reason."""
    found = relative_orientations(rays, np.array([0, len(rays.left)]), snooping_limit=snooping_limit, **settings)
    if not found.formed[0]:
        raise GeometryError(found.reasons[0])
    of_pair = {name: getattr(found, name)[0] for name in PER_PAIR}
    of_points = {name: getattr(found, name) for name in PER_POINT}
    points = Intersection(found.xyz, found.point_covariance, found.depth)
    return SimpleNamespace(**of_pair, **of_points, points=points, warnings=found.warnings.get(0, ()))
