"""What similarities take up of deformations is what two adjustments one after the other give, done point by point."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from aatri.geometry.strip_bases import StripAxes
from aatri.orientation.bodies.taken_up import SIZE, similarities, taken_up

FUNCTIONS, ACROSS = 5, 3
"""1, u, u^2, v, u v."""


def _axes(azimuth_deg: float, x: float, y: float) -> StripAxes:
    c, s = np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg))
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return StripAxes(np.array([x, y, 0.0]), np.array([1000.0, 300.0]), rotation, np.array([0.0, 400.0]))


STRIPS = (_axes(0.0, 0.0, 0.0), _axes(180.0, 30.0, 400.0), _axes(3.0, -20.0, 800.0))


def _observed(without: int = -1) -> tuple[np.ndarray, np.ndarray]:
    """Flat ground: strip and point of each observation, and the points' places; a strip may hang on nothing."""
    x, y = np.meshgrid(np.arange(-900.0, 901.0, 150.0), np.arange(-200.0, 1001.0, 100.0))
    place, rows = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), []
    for strip, axes in enumerate(STRIPS):
        inside = np.abs((place - axes.origin_m) @ axes.ground_from_axes)[:, :2] <= axes.half_range_m
        rows += [(strip, p + (1000 if strip == without else 0)) for p in np.flatnonzero(inside.all(axis=1))]
    return np.array(rows), place


def _columns(rows: np.ndarray, place: np.ndarray) -> np.ndarray:
    """On the ground, by similarities and by a bow in height of each strip: (3 n, 3 strips * 8)."""
    S = similarities(STRIPS, FUNCTIONS, ACROSS)
    bow = np.zeros((len(STRIPS), 3, FUNCTIONS, 1))
    bow[:, 2, 2] = 1.0
    made = np.concatenate([S, bow.reshape(len(STRIPS), -1, 1)], axis=2).reshape(len(STRIPS), 3, FUNCTIONS, SIZE + 1)
    found = np.zeros((len(rows), 3, len(STRIPS), SIZE + 1))
    for n, (strip, point) in enumerate(rows):
        axes = STRIPS[strip]
        u, v = ((place[point % 1000] - axes.origin_m) @ axes.ground_from_axes)[:2] / axes.half_range_m
        f = np.array([1.0, u, u * u, v, u * v])
        found[n, :, strip] = axes.ground_from_axes @ np.einsum("afk,f->ak", made[strip], f)
    return found.reshape(3 * len(rows), -1)


def _projected(D: np.ndarray, point: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Columns less their means over the observations of each point, of which there may be more than the rows."""
    each = D.reshape(len(point), 3, -1)
    mean = np.zeros((int(point.max()) + 1, 3, each.shape[2]))
    np.add.at(mean, point, each)
    return (each - (mean / np.maximum(count, 1)[:, None, None])[point]).reshape(D.shape)


@pytest.mark.parametrize("without", [-1, 2])
def test_strips_are_joined_by_ties_and_then_moved_onto_control(without: int) -> None:
    rows, place = _observed(without)
    D, point = _columns(rows, place), rows[:, 1]
    seen = np.bincount(point)
    control = np.flatnonzero(seen == 1)[::3]
    with_control = seen.copy()
    with_control[control] += 1
    z = np.arange(len(STRIPS)) * (SIZE + 1) + SIZE
    s = np.setdiff1d(np.arange(D.shape[1]), z)
    by_ties = D.T @ _projected(D, point, seen)
    by_all = D.T @ _projected(D, point, with_control)
    err = taken_up(csr_array(by_ties), csr_array(by_all), s, z, STRIPS)

    # The same, point by point: ties first, by least squares of smallest norm, then all points of control.
    T = _projected(D, point, seen)
    joined = D[:, z] - D[:, s] @ np.linalg.lstsq(T[:, s], T[:, z], rcond=1e-9)[0]
    at_control = np.repeat(np.isin(point, control), 3)
    component = [[0, 1, 2]] if without < 0 else [[0, 1], [2]]
    for strips in component:
        here = np.repeat(np.isin(rows[:, 0], strips), 3)
        X = place[point[here[::3]] % 1000] / 1000.0
        motion = np.zeros((len(X), 3, SIZE))
        motion[:, range(3), range(3)] = 1.0
        motion[:, 0, 3], motion[:, 1, 3], motion[:, 0, 4], motion[:, 1, 4] = X[:, 0], X[:, 1], -X[:, 1], X[:, 0]
        motion[:, 2, 5], motion[:, 2, 6] = X[:, 0], X[:, 1]
        M, used = motion.reshape(-1, SIZE), at_control[here]
        joined[here] -= M @ np.linalg.lstsq(M[used], joined[here][used], rcond=None)[0]
    np.testing.assert_allclose(D[:, z] + D[:, s] @ err, joined, atol=1e-8)


def test_strips_without_a_common_point_take_up_by_control_alone() -> None:
    n = len(STRIPS)
    z = np.arange(n) * (SIZE + 1) + SIZE
    s = np.setdiff1d(np.arange(n * (SIZE + 1)), z)
    by_all = np.kron(np.eye(n), np.eye(SIZE + 1) + 0.1)
    err = taken_up(csr_array(np.zeros_like(by_all)), csr_array(by_all), s, z, STRIPS)
    expected = -np.linalg.solve(by_all[np.ix_(s, s)], by_all[np.ix_(s, z)])
    np.testing.assert_allclose(err, expected, atol=1e-12)
