"""Motions of the whole among open directions, by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.openness import null_vectors
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.errors import GeometryError
from aatri.observations.poses import POINT, point_generator
from tests.adjustment.openness.test_null_vectors import trilateration


def _net(n: int = 3):
    (points,), (distances,), start = trilateration(n)
    points = replace(points, name=POINT, generator=point_generator)
    return points, distances, start


def _observed(points: Unknowns, start, which: dict[int, tuple[int, ...]]) -> Records:
    """Some coordinates of some points, as they are."""
    rows = np.array([(p, axis) for p, axes in which.items() for axis in axes], dtype=np.int32)
    target, eye = start[POINT].copy(), np.eye(3)

    def evaluate(state, some):
        p, axis = rows[some].T
        return (state[POINT][p, axis] - target[p, axis])[:, None], (eye[axis][:, None, :],)

    return Records(
        "coordinate", ((POINT, rows[:, 0].copy()),), evaluate, np.full((len(rows), 1), 100.0), np.ones(len(rows), bool)
    )


def _said(which: dict[int, tuple[int, ...]], *more: Records) -> str:
    points, distances, start = _net()
    given = [_observed(points, start, which)] if which else []
    with pytest.raises(GeometryError) as error:
        adjust_large([points], [distances, *given, *more], start)
    return error.value.what


def test_a_net_of_distances_lacks_shifts_and_rotations_but_no_scale() -> None:
    said = _said({})
    assert said.startswith("the observations leave 6 unknowns open: rotation about X, rotation about Y")
    assert "shift X, shift Y, shift Z of the whole block" in said
    assert "scale" not in said


def test_heights_leave_plan_and_azimuth() -> None:
    said = _said({0: (2,), 4: (2,), 8: (2,), 20: (2,)})
    assert said == "the observations leave 3 unknowns open: rotation about Z, shift X, shift Y of the whole block"


@pytest.mark.parametrize("which", [{}, {0: (2,), 4: (2,), 8: (2,), 20: (2,)}, {0: (0, 1, 2), 26: (0, 1, 2)}])
def test_large_problems_are_told_the_same(monkeypatch: pytest.MonkeyPatch, which: dict[int, tuple[int, ...]]) -> None:
    """Where the matrix is too large to be seen as a whole, as from 2,000 kept unknowns on."""
    small = _said(which)
    monkeypatch.setattr(null_vectors, "WHOLE", 10)
    assert _said(which) == small


def test_two_points_leave_the_turn_about_their_line() -> None:
    _, _, start = _net()
    a, b = start[POINT][0], start[POINT][26]
    axis = (b - a) / np.linalg.norm(b - a)
    said = _said({0: (0, 1, 2), 26: (0, 1, 2)})
    assert said.startswith("the observations leave 1 unknown open: rotation about the axis (")
    found = np.array([float(x) for x in said.split("(")[1].split(")")[0].split(",")])
    np.testing.assert_allclose(found * np.sign(found @ axis), axis, atol=0.006)


def test_a_part_that_nothing_joins_is_set_aside_by_name_unless_nothing_holds_the_rest() -> None:
    points, distances, start = _net()
    n = len(points.free)
    two = replace(
        points,
        free=np.ones((2 * n, 3), bool),
        ids=[*points.ids, *(f"far{k}" for k in range(n))],
        position=np.tile(points.position, (2, 1)),
    )
    a, b = (np.concatenate([block, block + n]).astype(np.int32) for _, block in distances.touches)
    xyz = np.concatenate([start[POINT], start[POINT] + 20.0])
    wanted = np.linalg.norm(xyz[a] - xyz[b], axis=1)

    def evaluate(state, rows):
        d = state[POINT][a[rows]] - state[POINT][b[rows]]
        length = np.linalg.norm(d, axis=1)
        J = (d / length[:, None])[:, None, :]
        return (length - wanted[rows])[:, None], (J, -J)

    both = Records("distance", ((POINT, a), (POINT, b)), evaluate, np.full((len(a), 1), 100.0), np.ones(len(a), bool))
    held = _observed(two, {POINT: xyz}, {0: (0, 1, 2), 8: (0, 1, 2), 20: (0, 1, 2)})
    result = adjust_large([two], [both, held], {POINT: xyz})
    text = "set aside, its observations do not determine it"
    assert [(note.text, note.ids) for note in result.notes] == [(text, tuple(f"point far{k}" for k in range(n)))]
    held = _observed(points, start, {0: (0, 1, 2), 8: (0, 1, 2), 20: (0, 1, 2)})
    alone = adjust_large([points], [distances, held], start)
    np.testing.assert_allclose(result.state[POINT][:n], alone.state[POINT], atol=1e-9)
    less = _observed(two, {POINT: xyz}, {0: (0, 1, 2), 8: (0, 1, 2)})  # a turn about a line is open in the rest, too
    with pytest.raises(GeometryError) as error:
        adjust_large([two], [both, less], {POINT: xyz})
    rest, far = error.value.what.split("; rotation about X")
    assert rest.endswith("of a part that nothing holds to the rest (point p1, p2, p3, p4, p5 and 20 more)")
    assert far.endswith("of a part that nothing holds to the rest (point far0, far1, far2, far3, far4 and 22 more)")


@pytest.mark.parametrize("levels", [1, 6])
def test_unknowns_that_move_along_are_named_with_the_motion_four_of_them(levels: int) -> None:
    """A common offset of all observed heights is a shift of the net, as are those of all levels together."""
    points, distances, start = _net()
    rows = np.arange(len(points.free), dtype=np.int32)
    target, up = start[POINT][:, 2].copy(), np.array([[[0.0, 0.0, 1.0]]])

    def evaluate(state, some):
        v = state[POINT][rows[some], 2] - target[some] - state["offset"][rows[some] % levels, 0]
        return v[:, None], (np.repeat(up, len(some), axis=0), -np.ones((len(some), 1, 1)))

    offset = Unknowns("offset", np.ones((levels, 1), bool), ("offset",), [f"level{k}" for k in range(levels)], add_step)
    touches = ((POINT, rows), ("offset", rows % levels))
    heights = Records("height", touches, evaluate, np.full((len(rows), 1), 100.0), np.ones(len(rows), bool))
    plan = _observed(points, start, {0: (0, 1), 8: (0, 1)})
    with pytest.raises(GeometryError) as error:
        adjust_large([points, offset], [distances, heights, plan], {**start, "offset": np.zeros((levels, 1))})
    along = "".join(f" with offset of offset level{k}" for k in range(min(levels, 4)))
    assert error.value.what.endswith(f"1 unknown open: shift Z of the whole block{along}")
