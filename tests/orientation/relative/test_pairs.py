"""Many pairs through the compiled loop, against `relative_orientation` of each pair alone."""

from __future__ import annotations

import numpy as np
import pytest

import aatri.adjustment.threads as threads
import aatri.orientation.relative.critical as degenerate
import aatri.orientation.relative.loops as loops
import aatri.orientation.relative.pairs as many
from aatri.adjustment.kernels import snooping
from aatri.adjustment.statistics import reliability
from aatri.adjustment.stepping import damping
from aatri.errors import GeometryError
from aatri.geometry import intersection
from aatri.geometry.coplanarity import RayPairs, essential_matrix, sampson
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.from_consensus import FromConsensus
from aatri.orientation.relative.kernels import model_points
from aatri.orientation.relative.kernels import sampson as kernel
from aatri.orientation.relative.orientations import common_points
from tests.adjustment import dense
from tests.complex_step import complex_step
from tests.orientation.relative.pairs import gruber_ground, rays_of, rotation, simulate
from tests.orientation.relative.reference import RelativeOrientation, relative_orientation

ORIGIN = np.zeros(3)


def _stacked(pairs: list[RayPairs]) -> tuple[RayPairs, np.ndarray]:
    start = np.cumsum([0, *(len(rays.left) for rays in pairs)])
    return RayPairs(
        *(np.concatenate([getattr(r, name) for r in pairs]) for name in RayPairs.__dataclass_fields__)
    ), start


def _pair(seed: int, *, points: int = 8, wrong: float = 0.0, kappa: float = 0.0, size_mm: float = 2.0) -> RayPairs:
    rng = np.random.default_rng(seed)
    X = gruber_ground(points, rng, relief=0.08)
    base = np.array([0.6, 0.0, 0.0]) + rng.normal(0, 0.03, 3)
    rays, _, _ = simulate(X, rotation(rng), rotation(rng, kappa=kappa), ORIGIN, base, rng)
    right, bad = rays.right.copy(), rng.random(len(X)) < wrong
    right[bad, :2] += rng.uniform(-size_mm, size_mm, (int(bad.sum()), 2))
    sigma = rng.uniform(0.7, 1.4, (len(X), 4)) * 0.005
    return RayPairs(rays.left, right, sigma[:, :2].copy(), sigma[:, 2:].copy())


def _spoiled(rays: RayPairs, rows: slice, shift: list[float]) -> RayPairs:
    right = rays.right.copy()
    right[rows] += shift
    return RayPairs(rays.left, right, rays.left_sigma, rays.right_sigma)


def _cylinder() -> RayPairs:
    angle = np.random.default_rng(1).uniform(-1, 1, 18)
    x = np.random.default_rng(2).uniform(0, 0.6, 18)
    X = np.column_stack([x, np.sin(2 * angle) * 0.5, -0.5 - 0.5 * np.cos(2 * angle)])
    return simulate(X, np.eye(3), np.eye(3), ORIGIN, np.array([0.6, 0, 0]))[0]


def _unlike() -> dict[str, RayPairs]:
    """Pairs of every kind, plain and not."""
    rng = np.random.default_rng(3)
    X = gruber_ground(4, rng, relief=0.05)
    b = np.array([0.6, 0.0, 0.0])
    corner = np.array([0.3, 0.5, -1.0]) + rng.uniform(-0.05, 0.05, (12, 3))
    crossed = _pair(12)
    behind = crossed.right.copy()
    behind[:3, 0] += 2 * (crossed.left[:3, 0] - crossed.right[:3, 0])
    return {
        "plain": _pair(1),
        "gross errors": _pair(2, wrong=0.15),
        "turned": _pair(3, kappa=np.pi),
        "none": _pair(4).take(np.zeros(0, dtype=np.intp)),
        "four": _pair(5).take(np.arange(4)),
        "five": _pair(6).take(np.arange(0, 45, 9)),
        "six": _pair(7).take(np.arange(0, 48, 8)),
        "seven": _pair(8).take(np.arange(0, 49, 7)[:7] % 48),
        "on a line": simulate(X * [1, 0, 1], np.eye(3), np.eye(3), ORIGIN, b)[0],
        "no base": simulate(X, np.eye(3), rotation(rng), ORIGIN, 1e-9 * b, rng)[0],
        "copied": rays_of(100 * X[:, :2], 100 * X[:, :2]),
        "unrelated": rays_of(rng.uniform(-90, 90, (18, 2)), rng.uniform(-90, 90, (18, 2))),
        "cylinder": _cylinder(),
        "corner": simulate(corner, rotation(rng), rotation(rng), ORIGIN, b, rng)[0],
        "behind": RayPairs(crossed.left, behind, crossed.left_sigma, crossed.right_sigma),
        "half wrong": _pair(13, wrong=0.5, size_mm=40.0),
        "large": _pair(14, points=120, wrong=0.1),
        "one huge": _spoiled(_pair(15), slice(4, 5), [50.0, 50.0, 0.0]),
        "last": _pair(16, wrong=0.05),
    }


def _orientation_or_error(rays: RayPairs) -> RelativeOrientation | GeometryError:
    try:
        return relative_orientation(rays)
    except GeometryError as error:
        return error


def _assert_as_alone(found: many.RelativeOrientations, rays: RayPairs, start: np.ndarray, pair: int) -> None:
    rows = np.arange(start[pair], start[pair + 1])
    alone = _orientation_or_error(rays.take(rows))
    if isinstance(alone, GeometryError):
        assert not found.formed[pair]
        assert found.reasons[pair]
        return
    assert found.formed[pair]
    assert found.warnings.get(pair, ()) == alone.warnings
    if (~alone.active).sum() > 0.3 * len(rows):  # another start; as many points may fit another orientation
        assert found.active[rows].sum() >= alone.active.sum()
        return
    np.testing.assert_array_equal(found.active[rows], alone.active)
    assert found.redundancy[pair] == alone.redundancy
    sigma = np.sqrt(np.diag(alone.covariance))
    assert np.abs(found.left_from_right[pair] - alone.left_from_right).max() < 1e-9 * sigma[:3].min()
    assert np.abs(found.base[pair] - alone.base).max() < 1e-9 * sigma[3:].min()
    scale = np.outer(sigma, sigma)
    np.testing.assert_allclose(found.covariance[pair] / scale, alone.covariance / scale, atol=1e-7)
    np.testing.assert_allclose(found.sigma0[pair], alone.sigma0, rtol=1e-9)
    for name in ("parallax_mm", "error_mm", "error_sigma_mm"):
        np.testing.assert_allclose(getattr(found, name)[rows], getattr(alone, name), rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(found.test[rows], alone.test, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found.xyz[rows], alone.points.xyz, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.depth[rows], alone.points.depth, rtol=1e-9)
    np.testing.assert_allclose(found.point_covariance[rows], alone.points.covariance, rtol=1e-8, atol=1e-20)
    np.testing.assert_array_equal(~(found.depth[rows] > 0).all(axis=1), alone.behind)


@pytest.mark.slow
def test_pairs_of_every_kind_come_out_as_each_alone() -> None:
    cases = _unlike()
    rays, start = _stacked(list(cases.values()))
    found = many.relative_orientations(rays, start, snooping_limit=4.0)
    for pair in range(len(cases)):
        _assert_as_alone(found, rays, start, pair)
    assert found.formed[0]
    assert sorted(found.reasons) == [
        k
        for k, name in enumerate(cases)
        if name in ("none", "four", "on a line", "no base", "copied", "unrelated", "cylinder", "half wrong")
    ]


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.0, 0.02, 0.1, 0.3])
def test_the_compiled_loop_rejects_and_readmits_as_the_numpy_form(wrong: float) -> None:
    pairs = [_pair(seed, points=3 + seed % 9, wrong=wrong, size_mm=0.1 * 4.0 ** (seed % 5)) for seed in range(40)]
    rays, start = _stacked(pairs)
    found = many.relative_orientations(rays, start, snooping_limit=4.0)
    for pair in range(len(pairs)):
        _assert_as_alone(found, rays, start, pair)


def test_plain_pairs_need_no_second_start(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [_pair(seed, points=10, wrong=0.05) for seed in range(20)]
    monkeypatch.setattr(FromConsensus, "__call__", None)
    assert many.relative_orientations(*_stacked(pairs)).formed.all()


def test_the_result_has_the_same_bits_for_any_number_of_threads_and_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    rays, start = _stacked(list(_unlike().values()))
    monkeypatch.setattr(loops, "WORTH_A_THREAD", 1)
    results = []
    for count, at_once in ((1, 500_000), (3, 500_000), (2, 100), (1, 1)):
        monkeypatch.setattr(threads, "default_threads", lambda count=count: count)
        monkeypatch.setattr(loops, "AT_ONCE", at_once)
        monkeypatch.setattr(degenerate, "PORTION", 200 if at_once > 100 else 3)
        results.append(many.relative_orientations(rays, start, snooping_limit=4.0))
    for other in results[1:]:
        for name in many.RelativeOrientations.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(other, name), getattr(results[0], name), err_msg=name)


def test_no_pairs_make_no_models() -> None:
    rays, _ = _stacked([_pair(1).take(np.zeros(0, dtype=np.intp))])
    found = many.relative_orientations(rays, np.array([0]))
    assert len(found.formed) == 0


def test_limits_of_the_options_hold_in_the_compiled_loop() -> None:
    rays, start = _stacked([_pair(21, points=6, wrong=0.1), _pair(22, points=2)])
    found = many.relative_orientations(rays, start, snooping_limit=2.5, min_points=20)
    assert found.reasons[1] == "12 common points, 20 are needed"
    alone = relative_orientation(rays.take(np.arange(start[0], start[1])), snooping_limit=2.5, min_points=20)
    np.testing.assert_array_equal(found.active[: start[1]], alone.active)


def test_compiled_distances_and_derivatives_are_those_of_the_numpy_form_and_of_complex_steps() -> None:
    rays = _pair(31)
    rng = np.random.default_rng(4)
    n = len(rays.left)
    table = np.concatenate([rays.left, rays.right, rays.left_sigma**2, rays.right_sigma**2], axis=1)
    for direction in (*np.eye(3), *-np.eye(3), rng.normal(size=3), rng.normal(size=3)):
        R = rotation(rng, kappa=rng.uniform(-3, 3))
        b = direction / np.linalg.norm(direction)
        pose = np.column_stack([R, b])
        work, T, N, g = np.full((n, 9), np.nan), np.empty((3, 3)), np.empty((5, 5)), np.empty(5)
        active = rng.random(n) < 0.7
        cost = kernel.linearise(pose, table, active, work, T, N, g)
        v, J = sampson(R, b, tangents(b), rays)
        np.testing.assert_allclose(T[1:], tangents(b).T, atol=1e-15)
        np.testing.assert_allclose(work[:, 0], v, rtol=1e-12, atol=1e-12 * np.abs(v).max())
        np.testing.assert_allclose(work[:, 1:6], J, atol=1e-12 * np.abs(J).max())
        np.testing.assert_allclose(N, np.tril(J[active].T @ J[active]), atol=1e-12 * np.abs(N).max())
        np.testing.assert_allclose(g, J[active].T @ v[active], atol=1e-12 * np.abs(J).max() * np.abs(v).max() * n)
        assert cost == pytest.approx(v[active] @ v[active], rel=1e-12)
        step = complex_step(lambda p, R=R, b=b: _distance(R, b, rays, p), np.zeros(5))
        np.testing.assert_allclose(work[:, 1:6], step, atol=1e-10 * np.abs(J).max())


def _distance(R: np.ndarray, b: np.ndarray, rays: RayPairs, p: np.ndarray) -> np.ndarray:
    """Sampson distances after a small step p, without conjugation: F over its propagated standard deviation."""
    turned = R + np.cross(p[:3][None], R.T).T
    E = essential_matrix(turned, b + tangents(b) @ p[3:])
    of_left, of_right = rays.right @ E.T, rays.left @ E
    gradient = np.concatenate([of_left[:, :2], of_right[:, :2]], axis=1)
    variance = np.concatenate([rays.left_sigma, rays.right_sigma], axis=1) ** 2
    return -(rays.left * of_left).sum(axis=1) / np.sqrt((gradient**2 * variance).sum(axis=1))


def test_both_forms_have_the_same_constants() -> None:
    assert snooping.UNCONTROLLED == reliability.UNCONTROLLED
    for name in ("ROUNDING", "FIRST", "GOOD", "SHRINK"):
        assert getattr(kernel, name) == getattr(damping, name)
    for name in ("FADING", "BEND", "AHEAD"):
        assert getattr(kernel, name) == getattr(dense, name)
    assert model_points.PARALLEL == intersection.PARALLEL


# -- common points of pairs of images --


def test_common_points_are_those_of_both_images_in_order() -> None:
    rng = np.random.default_rng(2)
    seen = [np.sort(rng.choice(60, n, replace=False)) for n in (0, 5, 40, 60, 33)]
    point, begin = np.concatenate(seen), np.concatenate([[0], np.cumsum([len(s) for s in seen])])
    images = np.array([[0, 1], [1, 2], [2, 3], [2, 4], [3, 4], [4, 1]])
    start, left, right = common_points(images, begin, point)
    assert start[0] == 0
    for k, (a, b) in enumerate(images):
        both = np.intersect1d(seen[a], seen[b])
        rows = slice(start[k], start[k + 1])
        np.testing.assert_array_equal(point[left[rows]], both)
        np.testing.assert_array_equal(point[right[rows]], both)
        assert ((left[rows] >= begin[a]) & (left[rows] < begin[a + 1])).all()
        assert ((right[rows] >= begin[b]) & (right[rows] < begin[b + 1])).all()


def test_no_pairs_have_no_common_points() -> None:
    start, left, right = common_points(
        np.zeros((0, 2), dtype=np.intp), np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    )
    assert start.tolist() == [0]
    assert len(left) == len(right) == 0
