"""A tangent frame of a sphere, written out for complex numbers: axes, heights and lines as they must be."""

from __future__ import annotations

from typing import Any

import numpy as np

from aatri.observations.level import Level
from tests.complex_step import complex_step

R = 6_371_000.0
CENTRE, POLE = np.array([0.0, 0.0, -R]), np.array([0.0, np.cos(0.8), np.sin(0.8)])


def axes(x: Any) -> Any:
    """East, north and up at a place, rows."""
    up = x - CENTRE
    up = up / np.sqrt((up**2).sum())
    east = np.cross(POLE, up)
    east = east / np.sqrt((east**2).sum())
    return np.stack([east, np.cross(up, east), up])


def height(x: Any) -> Any:
    """Height above the sphere."""
    return np.sqrt(((x - CENTRE) ** 2).sum()) - R


def line(a: Any, b: Any, above_a: float, above_b: float) -> Any:
    """The line from instrument to target in the axes of the station."""
    return axes(a) @ (b + above_b * axes(b)[2] - a - above_a * axes(a)[2])


def _each(f: Any, shape: tuple[int, ...]) -> Any:
    def at(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value = np.array([f(x) for x in xyz]).reshape(len(xyz), *shape)
        return value, np.array([complex_step(f, x) for x in xyz]).reshape(len(xyz), *shape, 3)

    return at


def _identity(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return xyz, np.broadcast_to(np.eye(3), (len(xyz), 3, 3))


ROUND = Level(_each(axes, (3, 3)), _each(height, ()), _identity, 1 / R, curved=True)
