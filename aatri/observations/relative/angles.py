"""Angles between lines of two points each: given, parallel, perpendicular.

    angle          v = atan2(|u x w|, u'w) - value,    at a point between two others
    perpendicular  v = atan2(u'w, |u x w|)
    parallel       v = (a'w, b'w) s,   a = k x u / |k x u|,   b = u x a

u, w unit vectors of the lines, s = +-1 so that opposite lines are parallel too; k is the axis of the frame that lies
most across u at the start. Residuals are angles: no area or length scales them. The angle has no derivative at 0 and at
180 degrees. Source: docs/formulas.md 5.5.
"""

from collections.abc import Callable

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.geometry.rotations import skew
from aatri.observations.geodetic.sights import inverse_sigmas
from aatri.observations.observed import ObservationSource, Observed, named
from aatri.observations.poses import POINT
from aatri.observations.relative.members import by_exactness, members_of
from aatri.observations.relative.shapes import NOTHING, seeing

ANGLE, PARALLEL, PERPENDICULAR = "relative_angle", "parallel", "perpendicular"

USES = ("relative_control:angle", "relative_control:parallel", "relative_control:perpendicular")

Pair = Callable[[Float, Float], tuple[Float, Float, Float]]
"""Unit vectors of the lines (n, 3) -> v (n, m), by the first and by the second (n, m, 3)."""


def relative_angles(source: ObservationSource) -> tuple[Observed, ...]:
    """Angles, parallel and perpendicular lines of the relative control."""
    observed: list[Observed] = []
    control, xyz = source.block.relative_control, source.start[POINT]
    for type_, kind in (("angle", ANGLE), ("parallel", PARALLEL), ("perpendicular", PERPENDICULAR)):
        for rows, exact in by_exactness(source.block, type_):
            members = [members_of(source.block, int(k)) for k in rows]
            point = np.array([m[0] for m in members])
            if type_ == "angle":
                point = point[:, [0, 1, 0, 2]]
            names = np.array(["-".join(m[1].tolist()) for m in members], dtype=np.str_)
            pair = _pair(type_, xyz, point)
            value = control.value[rows] if type_ == "angle" else np.zeros(len(rows))
            records = _records(kind, point, value, control.sigma[rows], pair, 2 if type_ == "parallel" else 1)
            observed.append(Observed(records, rows, named(point=names), "rad", exact=exact))
    return tuple(observed)


def _records(kind: str, point: Int, value: Float, sigma: Float, pair: Callable[[Int], Pair], rows: int) -> Records:
    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        x = state[POINT][point[chosen]]
        u, du = _unit(x[:, 1] - x[:, 0])
        w, dw = _unit(x[:, 3] - x[:, 2])
        v, by_u, by_w = pair(chosen)(u, w)
        by_first, by_second = by_u @ du, by_w @ dw
        ends: tuple[Float, ...] = (-by_first, by_first, -by_second, by_second)
        if kind == ANGLE:
            ends = (-by_first - by_second, by_first, by_second)
        return v - (value[chosen][:, None] if rows == 1 else 0.0), ends

    places = point[:, [0, 1, 3]] if kind == ANGLE else point
    touches = tuple((POINT, column.astype(np.int32)) for column in places.T)
    used = np.ones(len(point), dtype=bool)
    return Records(kind, touches, evaluate, inverse_sigmas(sigma, rows), used, similarity=seeing(NOTHING))


def _unit(line: Float) -> tuple[Float, Float]:
    """Unit vectors, and their derivatives by the lines, (n, 3, 3)."""
    size = np.linalg.norm(line, axis=1)
    u = line / size[:, None]
    return u, (np.eye(3) - u[:, :, None] * u[:, None, :]) / size[:, None, None]


def _angle(u: Float, w: Float) -> tuple[Float, Float, Float]:
    cross, dot = np.cross(u, w), np.einsum("ni,ni->n", u, w)
    sine = np.linalg.norm(cross, axis=1)
    # d|u x w| / du = (w x (u x w)) / |u x w| ... and of the dot product w
    by_sine_u, by_sine_w = np.cross(w, cross) / sine[:, None], np.cross(cross, u) / sine[:, None]
    size = (sine**2 + dot**2)[:, None]
    by_u = (dot[:, None] * by_sine_u - sine[:, None] * w) / size
    by_w = (dot[:, None] * by_sine_w - sine[:, None] * u) / size
    return np.arctan2(sine, dot)[:, None], by_u[:, None, :], by_w[:, None, :]


def _perpendicular(u: Float, w: Float) -> tuple[Float, Float, Float]:
    v, by_u, by_w = _angle(u, w)
    return np.pi / 2 - v, -by_u, -by_w


def _pair(type_: str, xyz: Float, point: Int) -> Callable[[Int], Pair]:
    """Rows -> the equation of a type."""
    if type_ == "parallel":
        return _parallel(xyz, point)
    return lambda _: _angle if type_ == "angle" else _perpendicular


def _parallel(xyz: Float, point: Int) -> Callable[[Int], Pair]:
    """Rows -> deviations of the second line across the first."""
    lines = np.nan_to_num(xyz[point[:, [1, 3]]] - xyz[point[:, [0, 2]]])
    axis = np.eye(3)[np.argmin(np.abs(lines[:, 0]), axis=1)]
    sign = np.where(np.einsum("ni,ni->n", lines[:, 0], lines[:, 1]) < 0, -1.0, 1.0)

    def of_rows(rows: Int) -> Pair:
        k, s = axis[rows], sign[rows]

        def pair(u: Float, w: Float) -> tuple[Float, Float, Float]:
            across = np.cross(k, u)
            size = np.linalg.norm(across, axis=1)
            a = across / size[:, None]
            b = np.cross(u, a)
            by_a = (np.eye(3) - a[:, :, None] * a[:, None, :]) / size[:, None, None] @ skew(k)
            by_b = skew(u) @ by_a - skew(a)
            w = s[:, None] * w
            v = np.stack([np.einsum("ni,ni->n", a, w), np.einsum("ni,ni->n", b, w)], axis=1)
            by_u = np.stack([np.einsum("ni,nij->nj", w, d) for d in (by_a, by_b)], axis=1)
            return v, by_u, np.stack([a, b], axis=1) * s[:, None, None]

        return pair

    return of_rows
