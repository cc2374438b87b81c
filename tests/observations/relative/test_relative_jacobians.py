"""Relative control: values and derivatives of every type against formulas written anew, by complex step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block, RelativeControl, RelativeControlMembers
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.relative.angles import relative_angles
from aatri.observations.relative.differences import relative_differences, relative_distances
from aatri.observations.relative.lines import LINE, lines
from aatri.observations.relative.planes import PLANE_SHAPE, planes
from aatri.observations.relative.round_shapes import CYLINDER, SPHERE, round_shapes
from tests.complex_step import complex_step
from tests.observations.geodetic.made_geodetic import geodetic_block

NAMES = "PQRSTU"


def _block(type_: str, parts: list[str], value: float = np.nan, axis: str = "", sigma: float = 0.01) -> Block:
    n = len(parts)
    control = RelativeControl(
        type=np.array([type_]),
        value=np.array([value]),
        sigma=np.array([sigma]),
        axis=np.array([axis]),
        file=np.zeros(1, np.int32),
        line=np.ones(1, np.int32),
    )
    members = RelativeControlMembers(
        condition=np.zeros(n, np.int32), part=np.array(parts), id=np.array(list(NAMES[:n]))
    )
    block = geodetic_block("distance", ("point", "point"), (0.0, 0.0))
    return replace(
        block,
        points=replace(block.points, id=np.array(list(NAMES))),
        relative_control=control,
        relative_control_members=members,
    )


def _observed(block: Block, xyz: np.ndarray) -> Observed:
    given = ObservationSource(
        block, None, np.zeros(3), {POINT: xyz, POSE: Poses(np.zeros((0, 3)), np.zeros((0, 3, 3)))}
    )
    functions = (planes, lines, round_shapes, relative_angles, relative_differences, relative_distances)
    (o,) = [o for f in functions for o in f(given)]
    return o


def _own_jacobian(o: Observed, state: dict[str, np.ndarray]) -> np.ndarray:
    """By the unknowns that the kind brings: they enter linearly enough for a central difference of small steps."""
    (group,) = o.start
    columns = []
    for k in range(state[group].shape[1]):
        step = np.zeros_like(state[group])
        step[:, k] = 1e-6
        up, down = (
            o.records.evaluate({**state, group: state[group] + s * step}, np.arange(len(o)))[0] for s in (1, -1)
        )
        columns.append((up - down) / 2e-6)
    return np.stack(columns, axis=2)


def _norm(x: Any) -> Any:
    return np.sqrt((x**2).sum())


def _plane(t: Any) -> Any:
    m = np.array([t[0], t[1], 1.0])
    return m / _norm(m)


def _across(x: Any, d: Any) -> Any:
    """Offset from the line through the origin."""
    d = d / _norm(d)
    return x - d * (x @ d)


@pytest.mark.parametrize(
    "type_", ["plane", "vertical_plane", "line", "plumb_line", "horizontal_line", "sphere", "cylinder"]
)
def test_distances_from_shapes_and_their_derivatives(type_: str) -> None:
    rng = np.random.default_rng(3)
    xyz = rng.normal(0, 5, (6, 3)) * [3, 2, 1]
    o = _observed(_block(type_, ["points"] * 6), xyz)
    (group,) = o.start
    state = {
        POINT: xyz + rng.normal(0, 0.3, xyz.shape),
        group: o.start[group] + rng.normal(0, 0.1, o.start[group].shape),
    }
    v, J = o.records.evaluate(state, np.arange(6))
    t = state[group][0]
    # distances by other formulas: from the normal or the direction that the derivatives by the points reveal
    for k in range(6):
        if type_ in ("plane", "vertical_plane"):
            np.testing.assert_allclose(np.linalg.norm(J[0][k, 0]), 1.0, atol=1e-12)
            if type_ == "vertical_plane":
                assert J[0][k, 0, 2] == pytest.approx(0.0, abs=1e-12)
        elif type_ in ("line", "plumb_line", "horizontal_line"):
            np.testing.assert_allclose(J[0][k] @ J[0][k].T, np.eye(2), atol=1e-12)
            np.testing.assert_allclose(J[0][k] - J[0][0], 0.0, atol=1e-12)
        else:
            np.testing.assert_allclose(np.linalg.norm(J[0][k, 0]), 1.0, atol=1e-12)
    moved = {**state, POINT: state[POINT] + 1e-5 * np.array([1.0, 2.0, -1.0])}
    expected = np.einsum("nij,j->ni", J[0], 1e-5 * np.array([1.0, 2.0, -1.0]))
    np.testing.assert_allclose(o.records.evaluate(moved, np.arange(6))[0] - v, expected, atol=1e-9)
    np.testing.assert_allclose(J[1], _own_jacobian(o, state), atol=1e-8)
    assert v.shape == (6, 2 if "line" in type_ else 1)
    assert (
        len(t)
        == {
            "plane": 3,
            "vertical_plane": 2,
            "line": 4,
            "plumb_line": 2,
            "horizontal_line": 3,
            "sphere": 4,
            "cylinder": 5,
        }[type_]
    )


@pytest.mark.parametrize("type_", ["plane", "sphere", "line", "cylinder"])
def test_equations_of_shapes_by_complex_step(type_: str) -> None:
    rng = np.random.default_rng(6)
    k = {"plane": 3, "sphere": 4, "line": 4, "cylinder": 5}[type_]
    x, t = rng.normal(0, 4, 3), rng.normal(0, 0.4, k)

    def basis(t: Any) -> Any:
        s, size = np.sqrt(1 + t[0] ** 2), np.sqrt(1 + t[0] ** 2 + t[1] ** 2)
        a = np.array([1.0, 0.0, -t[0]]) / s
        d = np.array([t[0], t[1], 1.0]) / size
        return a, np.array([d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]])

    def f(z: Any) -> Any:
        x, t = z[:3], z[3:]
        if type_ == "plane":
            return np.array([x @ _plane(t[:2]) - t[2]])
        if type_ == "sphere":
            return np.array([_norm(x - t[:3]) - t[3]])
        a, b = basis(t)
        offset = np.array([a @ x, b @ x]) - t[2:4]
        return offset if type_ == "line" else np.array([_norm(offset) - t[4]])

    shape = {"plane": PLANE_SHAPE, "sphere": SPHERE, "line": LINE, "cylinder": CYLINDER}[type_]
    v, by_x, by_t = shape.equation(x[None], t[None])
    z = np.concatenate([x, t])
    np.testing.assert_allclose(v[0], f(z), atol=1e-12)
    np.testing.assert_allclose(np.hstack([by_x[0], by_t[0]]), complex_step(f, z), atol=1e-11)
    if type_ == "line":  # the offsets have the length of the vector across the line
        assert np.linalg.norm(v[0] + t[2:]) == pytest.approx(_norm(_across(x, np.array([*t[:2], 1.0]))))


@pytest.mark.parametrize(
    "type_", ["angle", "parallel", "perpendicular", "equal_distance", "distance", "coordinate_difference"]
)
def test_conditions_between_lines_by_complex_step(type_: str) -> None:
    rng = np.random.default_rng(9)
    xyz = rng.normal(0, 5, (6, 3))
    if type_ == "parallel":
        xyz[3] = xyz[2] - (xyz[1] - xyz[0]) + rng.normal(0, 0.5, 3)  # opposite, about
    parts = {"angle": ["at", "between", "between"], "distance": ["points"] * 2, "coordinate_difference": ["points"] * 2}
    o = _observed(
        _block(
            type_,
            parts.get(type_, ["pairs"] * 4),
            0.7 if type_ in parts else np.nan,
            "Y" if type_ == "coordinate_difference" else "",
        ),
        xyz,
    )
    k = int(np.argmin(np.abs(xyz[1] - xyz[0])))

    def f(z: Any) -> Any:
        x = z.reshape(-1, 3)
        if type_ == "distance":
            return np.array([_norm(x[1] - x[0]) - 0.7])
        if type_ == "coordinate_difference":
            return np.array([x[1, 1] - x[0, 1] - 0.7])
        if type_ == "equal_distance":
            return np.array([_norm(x[1] - x[0]), _norm(x[3] - x[2])])
        u = x[1] - x[0]
        w = x[2] - x[0] if type_ == "angle" else x[3] - x[2]
        cosine = (u @ w) / _norm(u) / _norm(w)
        if type_ == "angle":
            return np.array([np.arccos(cosine) - 0.7])
        if type_ == "perpendicular":
            return np.array([np.arcsin(cosine)])
        u, w = u / _norm(u), -w / _norm(w)
        e = np.eye(3)[k]
        a = np.array([e[1] * u[2] - e[2] * u[1], e[2] * u[0] - e[0] * u[2], e[0] * u[1] - e[1] * u[0]])
        a = a / _norm(a)
        b = np.array([u[1] * a[2] - u[2] * a[1], u[2] * a[0] - u[0] * a[2], u[0] * a[1] - u[1] * a[0]])
        return np.array([a @ w, b @ w])

    state = {POINT: xyz, **o.start}
    v, J = o.records.evaluate(state, np.arange(len(o)))
    m = 3 if type_ == "angle" else 2 if type_ in ("distance", "coordinate_difference") else 4
    expected = complex_step(f, xyz[:m].ravel())
    if type_ == "equal_distance":
        length = o.start["equal_distance"][0, 0]
        np.testing.assert_allclose(v[:, 0], f(xyz[:4].ravel()).real - length, atol=1e-12)
        for row in range(2):
            mine = np.hstack([J[0][row], J[1][row]])[0]
            np.testing.assert_allclose(mine, expected[row, 6 * row : 6 * row + 6], atol=1e-11)
        return
    np.testing.assert_allclose(v[0], f(xyz[:m].ravel()).real, atol=1e-12)
    np.testing.assert_allclose(np.hstack([j[0] for j in J]), expected, atol=1e-10)
