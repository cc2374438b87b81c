"""Relative control of a block: points of its own that fulfil a condition, and the conditions as the block states them.

Points stand at random places of the block, on shapes that hold exactly in Cartesian coordinates and the axes of their
place (heights: in those of the block). The error of an observed condition is put into its points, which leave the shape
by it; conditions with a value (distance, difference, angle) have it in the value. So have gross errors.

Shapes are laid out in the axes (east, north, up) of their place so that the condition holds exactly, with the
directions in which its members leave it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.artifacts import block as b
from aatri.simulation.measured import Disturbance, gross_errors
from aatri.simulation.rays import Photography
from aatri.simulation.survey_settings import SurveyOptions

VALUED = ("distance", "coordinate_difference", "angle")
"""Conditions with an observed value: the points are free, and the error is in the value."""
ANGULAR = ("angle", "parallel", "perpendicular")
LEVEL = ("horizontal_plane", "equal_height")
"""Conditions on heights, which are those of the block, not of the axes at one place."""
PAIRS = 3
"""Pairs of equal distances."""

KIND = {"distance": "relative_distance", "coordinate_difference": "relative_difference", "angle": "relative_angle"}
"""Kinds of observation that are not called as their conditions."""
ONE_ROW = ("parallel", "perpendicular")
"""Conditions whose error is of the condition, not of a point."""


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


@dataclass(frozen=True)
class Structure:
    """A condition and its points."""

    type: str
    number: int
    """Of its type, from 1."""
    offset_m: Float
    """(m, 3), m. Its points from its place, in the axes there, with their errors."""
    sigma: float
    """0 exact, m or rad."""
    radius_m: float
    gross: Float
    """(m, 2), m or rad. Gross errors of the points; the first of a condition with a value is that of the value."""
    of_value: float
    """Error of a value, m or rad."""
    local_m: Float = field(default_factory=lambda: np.zeros((0, 3)))
    """(m, 3), m. E, N, h, where it stands."""

    def ids(self) -> list[str]:
        """Ids of its points."""
        width = len(str(len(self.offset_m)))
        return [f"{self.type}{self.number:02d}-{k + 1:0{width}d}" for k in range(len(self.offset_m))]

    def standing(self, photography: Photography, place_m: Float) -> Structure:
        """The structure at a place (E, N, h)."""
        if self.type in LEVEL:
            return replace(self, local_m=place_m + self.offset_m)
        axes = photography.axes(place_m[None])[0]
        away = photography.cartesian(place_m[None]) + self.offset_m @ axes.T
        return replace(self, local_m=photography.local(away))


def planned_structures(settings: SurveyOptions, disturbance: Disturbance) -> list[Structure]:
    """A structure for every condition asked for, not yet at a place."""
    numbered_types = [(str(t), k + 1) for t, count in sorted(settings.relative.items()) for k in range(count)]
    rng = disturbance.streams["structure"]
    laid = [laid_out(t, settings.points_per_shape, settings.shape_size_m, rng) for t, _ in numbered_types]
    sigma = [_sigma(t, disturbance, settings.exact) for t, _ in numbered_types]
    gross = _gross(numbered_types, laid, sigma, disturbance)
    errors = disturbance.streams["structure_error"]
    structures = []
    for (type_, number), shape, s, wrong in zip(numbered_types, laid, sigma, gross):
        noise = disturbance.noise.factor * s * errors.standard_normal((len(shape.offset_m), 2))
        away = np.einsum("mk,mki->mi", noise + wrong, shape.away)
        of_value = float(noise[0, 0] + wrong[0, 0]) if type_ in VALUED else 0.0
        structures.append(Structure(type_, number, shape.offset_m + away, s, shape.radius_m, wrong, of_value))
    return structures


def _sigma(type_: str, disturbance: Disturbance, exact: bool) -> float:
    noise = disturbance.noise
    return 0.0 if exact else float(np.radians(noise.relative_deg)) if type_ in ANGULAR else noise.relative_m


def _gross(
    numbered_types: list[tuple[str, int]], laid: list[Laid], sigma: list[float], disturbance: Disturbance
) -> list[Float]:
    """Gross errors, as many rows as points for each condition."""
    counts = [len(shape.offset_m) for shape in laid]
    open_to = [np.zeros((n, 2)) for n in counts]
    for (type_, _), shape, s, amplitude in zip(numbered_types, laid, sigma, open_to):
        if type_ in VALUED:
            amplitude[0, 0] = s
        else:
            amplitude[:] = s * (np.abs(shape.away).sum(axis=2) > 0)
    stacked = np.concatenate([np.zeros((0, 2)), *open_to])
    much, size = disturbance.gross.relative_control, disturbance.gross.size_sigmas
    chosen, errors = gross_errors(much, stacked, size, disturbance.streams["gross_structure"], "relative_control")
    stacked[:] = 0.0
    stacked[chosen] = errors
    return [stacked[end - n : end] for n, end in zip(counts, np.cumsum(counts))]


def relative_control(
    structures: list[Structure], photography: Photography, in_block: Any
) -> tuple[b.RelativeControl, b.RelativeControlMembers, list[tuple[Any, ...]]]:
    """The tables of the conditions, in canonical order, and the gross errors in them.

    Parameters
    ----------
    in_block : callable
        Local coordinates to those of the block.
    """
    if not structures:
        return b.RelativeControl.empty(), b.RelativeControlMembers.empty(), []
    axis = {id(s): "XYZ"[(s.number - 1) % 3] if s.type == "coordinate_difference" else "" for s in structures}
    order = sorted(structures, key=lambda s: (s.type, axis[id(s)], s.ids()))
    values = [_value(s, axis[id(s)], photography, in_block) for s in order]
    table = b.RelativeControl.of(
        type=[s.type for s in order],
        value=values,
        sigma=[s.sigma for s in order],
        axis=[axis[id(s)] for s in order],
    )
    parts = [[p for p, _ in _members(s)] for s in order]
    members = b.RelativeControlMembers.of(
        condition=np.repeat(np.arange(len(order)), [len(p) for p in parts]),
        part=[p for structure_parts in parts for p in structure_parts],
        id=[name for s in order for _, name in _members(s)],
    )
    return table, members, _gross_by_kind(order, parts)


def _gross_by_kind(order: list[Structure], parts: list[list[str]]) -> list[tuple[Any, ...]]:
    """Gross errors by kind of observation, with the row that its residuals have."""
    gross: list[tuple[Any, ...]] = []
    first = np.cumsum([0, *(len(p) for p in parts)])
    for type_ in dict.fromkeys(s.type for s in order):
        at: list[int] = []
        errors: list[Float] = []
        for k, s in enumerate(order):
            for member in np.flatnonzero(np.abs(s.gross).sum(axis=1)) if s.type == type_ else ():
                own = member - member % 2 if type_ == "equal_distance" else member
                at.append(k if type_ in (*VALUED, *ONE_ROW) else int(first[k] + own))
                errors.append(s.gross[member])
        if at:
            gross.append((KIND.get(type_, type_), np.array(at), np.array(errors)))
    return gross


def _members(s: Structure) -> list[tuple[str, str]]:
    ids = s.ids()
    if s.type == "angle":
        return [("at", ids[0]), ("between", ids[1]), ("between", ids[2])]
    return [("pairs" if s.type in ("equal_distance", *ONE_ROW) else "points", name) for name in ids]


def _value(s: Structure, axis: str, photography: Photography, in_block: Any) -> float:
    """The observed value; a radius is known for every other one."""
    if s.type in ("sphere", "cylinder"):
        return s.radius_m if s.number % 2 else np.nan
    if s.type == "coordinate_difference":
        low, high = in_block(s.local_m)[:, "XYZ".index(axis)]
        return float(high - low) + s.of_value
    X = photography.cartesian(s.local_m)
    if s.type == "distance":
        return float(np.linalg.norm(X[1] - X[0])) + s.of_value
    if s.type == "angle":
        u, w = X[1] - X[0], X[2] - X[0]
        return float(np.arccos(u @ w / np.sqrt((u @ u) * (w @ w)))) + s.of_value
    return float("nan")
