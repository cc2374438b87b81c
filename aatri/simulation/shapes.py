"""Points that fulfil a condition of relative control, in the axes (east, north, up) of their place.

Each is laid out so that it holds exactly, with the directions in which its members leave it: what an observed
condition has of errors is in its points.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float

VALUED = ("distance", "coordinate_difference", "angle")
"""Conditions with an observed value: the points are free, and the error is in the value."""
ANGULAR = ("angle", "parallel", "perpendicular")
LEVEL = ("horizontal_plane", "equal_height")
"""Conditions on heights, which are those of the block, not of the axes at one place."""
PAIRS = 3
"""Pairs of equal distances."""


@dataclass(frozen=True)
class Laid:
    """Points of one condition."""

    offset_m: Float
    """(m, 3), m. From the place of the condition."""
    away: Float
    """(m, 2, 3). By how much a point moves for a unit error, along two directions: zeros where it has fewer."""
    radius_m: float = float("nan")
    """NaN where there is none."""


def laid_out(type_: str, points: int, size_m: float, rng: np.random.Generator) -> Laid:
    """Points of a condition of some type, of the given extent."""
    if type_ in ("distance", "coordinate_difference"):
        return _fixed(rng.uniform(-0.5, 0.5, (2, 3)) * size_m + [[0, 0, 0], [size_m, size_m, 0.5 * size_m]])
    if type_ == "angle":
        sides = _turned(rng) @ _between(np.radians(rng.uniform(40, 140))).T * size_m
        return _fixed(np.stack([np.zeros(3), *sides.T]))
    if type_ == "equal_distance":
        return _equal(size_m, rng)
    if type_ in ("parallel", "perpendicular"):
        return _two_lines(type_, size_m, rng)
    if type_ in ("sphere", "cylinder"):
        return _round(type_, points, size_m, rng)
    return _flat(type_, points, size_m, rng)


def _fixed(offset_m: Float) -> Laid:
    return Laid(offset_m, np.zeros((len(offset_m), 2, 3)))


def _turned(rng: np.random.Generator) -> Float:
    """A random rotation."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def _between(angle_rad: float) -> Float:
    """Two unit vectors, rows, that include an angle."""
    return np.array([[1.0, 0.0, 0.0], [np.cos(angle_rad), np.sin(angle_rad), 0.0]])


def _upright(rng: np.random.Generator) -> Float:
    """Axes, columns: along a random horizontal direction, across it, up."""
    turn = rng.uniform(0, 2 * np.pi)
    along, up = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([0.0, 0.0, 1.0])
    return np.stack([along, np.cross(up, along), up], axis=1)


def _flat(type_: str, points: int, size_m: float, rng: np.random.Generator) -> Laid:
    """Planes and lines: `extent` along some of three axes, errors along the others."""
    axes = _turned(rng) if type_ in ("plane", "line") else _upright(rng)
    extent = {"plane": (0, 1), "vertical_plane": (0, 2), "line": (0,), "plumb_line": (2,), "horizontal_line": (0,)}
    along = extent.get(type_, (0, 1))
    across = [k for k in range(3) if k not in along]
    inside = np.zeros((points, 3))
    for k in along:
        inside[:, k] = (rng.permutation(points) + rng.uniform(0.1, 0.9, points)) / points - 0.5
    away = np.zeros((points, 2, 3))
    away[:, : len(across)] = axes[:, across].T
    return Laid(size_m * inside @ axes.T, away)


def _equal(size_m: float, rng: np.random.Generator) -> Laid:
    """Pairs of equal length; the second point of each leaves along its line."""
    start = rng.uniform(-1, 1, (PAIRS, 3)) * size_m * np.array([1.0, 1.0, 0.2])
    line = rng.standard_normal((PAIRS, 3))
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    away = np.zeros((2 * PAIRS, 2, 3))
    away[1::2, 0] = line
    return Laid(np.stack([start, start + size_m * line], axis=1).reshape(-1, 3), away)


def _two_lines(type_: str, size_m: float, rng: np.random.Generator) -> Laid:
    """Two lines of two points; the end of the second turns it: across it (parallel) or towards the first."""
    axes = _turned(rng)
    second = axes[:, 0] if type_ == "parallel" else axes[:, 1]
    start = size_m * np.array([0.5, 1.0, 0.2])
    offset = np.stack([0 * start, size_m * axes[:, 0], start, start + size_m * second])
    away = np.zeros((4, 2, 3))
    if type_ == "parallel":
        away[3] = size_m * axes[:, 1:].T
    else:
        away[3, 0] = size_m * axes[:, 0]
    return Laid(offset, away)


def _round(type_: str, points: int, size_m: float, rng: np.random.Generator) -> Laid:
    """Points all around a sphere or a cylinder, errors along the radius."""
    radius, axes = 0.5 * size_m, _turned(rng)
    turn = 2 * np.pi * (np.arange(points) + rng.uniform(-0.3, 0.3, points)) / points
    height = (rng.permutation(points) + rng.uniform(0.2, 0.8, points)) / points * 2 - 1
    if type_ == "sphere":
        flat = np.sqrt(1 - height**2)
        out = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
        offset = radius * out
    else:
        out = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
        offset = radius * out + np.outer(size_m * height, [0, 0, 1.0])
    away = np.zeros((points, 2, 3))
    away[:, 0] = out @ axes.T
    return Laid(offset @ axes.T, away, radius)
