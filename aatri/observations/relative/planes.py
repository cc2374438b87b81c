"""Points of one plane: any, vertical, horizontal.

    plane       v = n'(x - 0) - d,   n = (t1, t2, 1) / sqrt(1 + t1^2 + t2^2)
    vertical    the same with t2 = 0, the second axis being the vertical
    horizontal  v = H(X) - h,        also `equal_height`: points of a lake shore

x are coordinates in the axes of the plane at the start, its normal the last. Source: docs/formulas.md 5.5.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int
from aatri.geometry.vectors import finite_rows
from aatri.notes import Note
from aatri.observations.geodetic.sights import HEIGHT
from aatri.observations.observed import NEARLY_EXACT, Given, Observed, named
from aatri.observations.poses import POINT, point_generator
from aatri.observations.relative.members import conditions, members_of
from aatri.observations.relative.shapes import TILT, Shape, along_horizontal, main_axes, means, observed_shapes, seeing

LEVEL_TYPES = ("horizontal_plane", "equal_height")

USES = tuple(f"relative_control:{t}" for t in ("plane", "vertical_plane", *LEVEL_TYPES))


def planes(given: Given) -> tuple[Observed, ...]:
    """Points of planes, and of equal height."""
    found = [*observed_shapes(given, PLANE_SHAPE), *observed_shapes(given, VERTICAL)]
    for type_ in LEVEL_TYPES:
        row = conditions(given.block, type_)
        for exact in (False, True):
            some = row[(given.block.relative_control.sigma[row] == 0) == exact]
            if len(some):
                found.append(_level(given, type_, some, exact))
    return tuple(found)


def _plane(x: Float, t: Float) -> tuple[Float, Float, Float]:
    m = np.column_stack([t[:, :2], np.ones(len(t))])
    size = np.linalg.norm(m, axis=1)
    n = m / size[:, None]
    distance = np.einsum("ni,ni->n", n, x)
    by_t = (x[:, :2] - distance[:, None] * n[:, :2]) / size[:, None]
    return (distance - t[:, 2])[:, None], n[:, None, :], np.column_stack([by_t, -np.ones(len(t))])[:, None, :]


def _vertical(x: Float, t: Float) -> tuple[Float, Float, Float]:
    v, by_x, by_t = _plane(x, np.column_stack([t[:, 0], np.zeros(len(t)), t[:, 1]]))
    return v, by_x, by_t[:, :, [0, 2]]


def _fit_plane(points: Float, _axes: Float) -> tuple[Float, Float, Float]:
    return main_axes(points), points.mean(axis=0), np.zeros(3)


def _fit_vertical(points: Float, axes: Float) -> tuple[Float, Float, Float]:
    along, up = along_horizontal(points, axes), axes[2]
    return np.array([along, up, np.cross(along, up)]), points.mean(axis=0), np.zeros(2)


PLANE_SHAPE = Shape("plane", ("tilt 1", "tilt 2", "offset"), 1, _plane, _fit_plane)
VERTICAL = Shape("vertical_plane", ("turn", "offset"), 1, _vertical, _fit_vertical, TILT)


def _level(given: Given, type_: str, row: Int, exact: bool) -> Observed:
    """Points of one height, which is unknown."""
    block, level = given.block, given.level
    members = [members_of(block, int(k)) for k in row]
    point = np.concatenate([m[0] for m in members]).astype(np.int32)
    of = np.repeat(np.arange(len(row)), [len(m[0]) for m in members]).astype(np.int32)
    group = f"exact_{type_}" if exact else type_

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        h, by_point = level.height(state[POINT][point[some]])
        v = h - state[group][of[some], 0]
        return v[:, None], (by_point[:, None, :], -np.ones((len(some), 1, 1)))

    def generator(state: State) -> Float:
        known = np.flatnonzero(finite_rows(state[POINT][point]))
        _, by_point = level.height(state[POINT][point[known]])
        along = (by_point[:, None, :] @ point_generator(state)[point[known]])[:, 0]
        return means(along, of[known], len(row))[:, None, :]

    known = np.flatnonzero(finite_rows(given.start[POINT][point]))
    start = means(level.height(given.start[POINT][point[known]])[0][:, None], of[known], len(row))
    sigma = block.relative_control.sigma[row][of]
    records = Records(
        type_,
        ((POINT, point), (group, of)),
        evaluate,
        1.0 / np.where(sigma > 0, sigma, NEARLY_EXACT)[:, None],
        np.ones(len(of), dtype=bool),
        similarity=seeing(TILT),
    )
    labels = np.array([" ".join(m[1].tolist()[:4]) for m in members], dtype=np.str_)
    unknowns = Unknowns(group, np.ones((len(row), 1), dtype=bool), ("height",), labels, add_step, generator=generator)
    text = f"{type_}: {len(row)} conditions {'exact' if exact else 'observed'}, redundancy gained {len(of) - len(row)}"
    member = np.flatnonzero(np.isin(block.relative_control_members.condition, row))
    return Observed(
        records,
        member,
        named(point=np.concatenate([m[1] for m in members])),
        "m",
        unknowns=(unknowns,),
        refitted=lambda start: _level(replace(given, start=start), type_, row, exact),
        start={group: start},
        exact=exact,
        sees=HEIGHT if not level.curved else (True,) * 3,
        notes=(Note("note", text, tuple(labels.tolist())),),
    )
