"""Free network: inner constraints against the pseudo-inverse and the bordered system of the dense normal matrix."""

from __future__ import annotations

import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.adapters.bundle.block_start import start_origin
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.covariance.s_transformation import s_transformation
from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.arrays import Bool
from aatri.errors import GeometryError
from aatri.observations.control import Control
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import Positions
from aatri.orientation.bundle.blunders.search import _Search
from aatri.orientation.bundle.result import BundleResult, gains_of_observations
from tests.adjustment.reference import dense_jacobian, free_columns
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import Parts, adjust_bundle

TIGHT = {"tolerance": 1e-9}


@pytest.fixture(scope="module")
def given() -> Parts:
    return replace(made_bundle(), marked=np.arange(30) % 4 == 0)


@pytest.fixture(scope="module")
def free(given: Parts) -> BundleResult:
    return adjust_bundle(given, datum="free", **TIGHT)


def _all_free(result: BundleResult):
    """The unknowns of a block with nothing held for the datum, the dense Jacobian there, the columns of its scalars."""
    unknowns = [replace(u, free=np.ones_like(u.free)) for u in result.adjusted.problem.unknowns]
    J, _ = dense_jacobian(unknowns, result.adjusted.problem.records, result.adjusted.state)
    return J, free_columns(unknowns)


def _seven(result: BundleResult, columns) -> np.ndarray:
    """The seven directions written down one by one: shifts, rotations about the axes and scale about the centroid."""
    poses, xyz = result.adjusted.state[POSE], result.adjusted.state[POINT]
    H = np.zeros((columns[POINT].max() + 1, 7))
    centre = xyz.mean(axis=0)
    for at, x in ((columns[POSE][:, :3], poses.position_m - centre), (columns[POINT], xyz - centre)):
        for k in range(3):
            H[at[:, k], k] = 1.0
            H[at, 3 + k] = np.cross(np.eye(3)[k], x)
        H[at, 6] = x
    for k in range(3):
        H[columns[POSE][:, 3 + k], 3 + k] = 1.0
    return H


def _bordered(J, G):
    """Upper left block of [N G; G' 0]^-1, scaled against the different units."""
    N = J.T @ J
    scale = 1 / np.sqrt(np.diag(N))
    border = scale[:, None] * G
    border = border / np.linalg.norm(border, axis=0)
    whole = np.block([[scale[:, None] * N * scale, border], [border.T, np.zeros((7, 7))]])
    return scale[:, None] * np.linalg.inv(whole)[: len(N), : len(N)] * scale


@pytest.mark.parametrize("over", ["points", "images", "marked"])
def test_covariances_are_those_of_the_system_bordered_by_inner_constraints(given: Parts, over: str) -> None:
    result = adjust_bundle(given, datum="free", datum_over=over, **TIGHT)  # type: ignore[arg-type]
    J, columns = _all_free(result)
    H = _seven(result, columns)
    np.testing.assert_allclose(J @ H, 0.0, atol=1e-7 * np.abs(J).max())
    chosen = {"points": columns[POINT], "images": columns[POSE][:, :3], "marked": columns[POINT][::4]}[over].ravel()
    G = np.zeros_like(H)
    G[chosen] = H[chosen]
    Q = _bordered(J, G)
    for found, c in ((result.pose_covariance, columns[POSE]), (result.point_covariance_m2, columns[POINT])):
        expected = Q[c[:, :, None], c[:, None, :]]
        scale = np.sqrt(np.einsum("nii->ni", expected))
        relative = (found - expected) / (scale[:, :, None] * scale[:, None, :])
        assert np.abs(relative).max() < 1e-8


def test_with_a_datum_of_all_scalars_the_covariance_is_the_pseudo_inverse(free: BundleResult) -> None:
    """Which is the upper left block of the inverse bordered by all of H; NumPy's own loses digits in mixed units."""
    adjusted = free.adjusted
    J, columns = _all_free(free)
    H = _seven(free, columns)
    Q = _bordered(J, H)
    np.testing.assert_allclose(Q, np.linalg.pinv(J.T @ J, rcond=1e-13, hermitian=True), atol=1e-6 * np.abs(Q).max())
    held = marginal_covariances(adjusted).groups
    every = {u.name: np.ones(u.free.shape, dtype=bool) for u in adjusted.problem.unknowns}
    open_ = {g: H[c] for g, c in columns.items()}
    found = s_transformation(adjusted.problem, adjusted.state, open_, every).covariances(held)
    for group, c in columns.items():
        expected = Q[c[:, :, None], c[:, None, :]]
        scale = np.sqrt(np.einsum("nii->ni", expected))
        relative = (found[group] - expected) / (scale[:, :, None] * scale[:, None, :])
        assert np.abs(relative).max() < 1e-8


def test_no_datum_has_a_smaller_trace_over_the_points_of_the_datum(given: Parts, free: BundleResult) -> None:
    def trace(result: BundleResult) -> float:
        return float(np.einsum("nii->", result.point_covariance_m2))

    others = [adjust_bundle(given, datum="minimal", **TIGHT)]
    others += [adjust_bundle(given, datum="free", datum_over=over, **TIGHT) for over in ("images", "marked")]
    assert all(trace(free) < trace(other) for other in others)
    marked = given.marked
    assert np.einsum("nii->", others[2].point_covariance_m2[marked]) < np.einsum(
        "nii->", free.point_covariance_m2[marked]
    )


def test_sigma0_residuals_and_redundancy_numbers_do_not_depend_on_the_datum(given: Parts, free: BundleResult) -> None:
    minimal = adjust_bundle(given, datum="minimal", **TIGHT)
    assert free.adjusted.redundancy == minimal.adjusted.redundancy
    assert free.adjusted.sigma0 == pytest.approx(minimal.adjusted.sigma0, rel=1e-9)
    v, w = (r.adjusted.problem.records[0].residuals(r.adjusted.state) for r in (free, minimal))
    np.testing.assert_allclose(v, w, atol=1e-9)
    np.testing.assert_allclose(free.observations[0].covariance, minimal.observations[0].covariance, atol=1e-7)


@pytest.mark.parametrize("over", ["points", "images", "marked"])
def test_the_datum_has_no_shift_rotation_or_scale_against_its_start(given: Parts, over: str) -> None:
    result = adjust_bundle(given, datum="free", datum_over=over, **TIGHT)  # type: ignore[arg-type]
    if over == "images":
        x, x0 = result.poses.position_m, given.poses.position_m
    else:
        some = given.marked if over == "marked" else np.ones(30, bool)
        x, x0 = result.xyz_m[some], given.xyz_m[some]
    shift, away = x - x0, x - x.mean(axis=0)
    assert np.abs(shift).max() > 0.1
    np.testing.assert_allclose(shift.sum(axis=0), 0.0, atol=1e-8)
    np.testing.assert_allclose(np.cross(away, shift).sum(axis=0), 0.0, atol=1e-5)
    np.testing.assert_allclose((away * shift).sum(), 0.0, atol=1e-5)


def _positions(given: Parts, sigma_m: float = 0.1) -> Positions:
    n = len(given.image_ids)
    covariance = np.tile(sigma_m**2 * np.eye(3), (n, 1, 1))
    return Positions(
        np.arange(n, dtype=np.int32), np.arange(n, dtype=np.int32), given.poses.position_m, covariance, np.zeros((n, 3))
    )


def _control(given: Parts, points, observed) -> Control:
    n = len(points)
    at = np.array(points, dtype=np.int32)
    used = np.tile(np.array(observed, dtype=bool), (n, 1))
    return Control(at, at, given.xyz_m[at], np.tile(0.01 * np.eye(3), (n, 1, 1)), used, np.zeros((n, 3), dtype=bool))


def test_with_observed_positions_of_all_images_nothing_is_free(given: Parts) -> None:
    with pytest.raises(GeometryError, match="nothing is free"):
        adjust_bundle(replace(given, positions=_positions(given)), datum="free")


@pytest.mark.parametrize(
    ("points", "observed", "defect"),
    [((3,), (1, 1, 1), 4), ((3, 9), (1, 1, 1), 1), ((2, 5, 11, 17), (0, 0, 1), 3)],
)
def test_what_control_leaves_open_is_free_and_the_rest_is_kept(points, observed, defect: int) -> None:
    """One point: rotations and scale; two: the rotation about their line; heights: shift in plan, azimuth.

    Control has errors of half its standard deviation.
    """
    given = made_bundle(start_error=0.05)
    partly = replace(given, control=_control(given, points, observed))
    result = adjust_bundle(partly, datum="free", **TIGHT)
    total = 6 * 6 + 30 * 3
    assert result.adjusted.n_unknowns == total - defect
    minimal = adjust_bundle(given, datum="minimal", **TIGHT)
    extra = len(points) * sum(observed) - (7 - defect)
    assert result.adjusted.redundancy == minimal.adjusted.redundancy + extra
    J, _ = _all_free(result)
    assert np.linalg.matrix_rank(J / np.linalg.norm(J, axis=0), tol=1e-8) == total - defect
    held = marginal_covariances(result.adjusted).groups[POINT]
    assert np.einsum("nii->", result.point_covariance_m2) < np.einsum("nii->", held)


def test_a_datum_that_cannot_carry_the_seven_is_refused(given: Parts) -> None:
    two = replace(given, marked=np.arange(30) < 2)
    with pytest.raises(GeometryError, match="do not carry the 7 components"):
        adjust_bundle(two, datum="free", datum_over="marked")


def test_a_datum_that_moves_on_a_curve_is_followed_along_it() -> None:
    """Three heights leave a scale open that goes with a tilt; a step along it leaves the heights to second order."""
    given = made_bundle(start_error=0.05)
    heights = _control(given, (3, 9, 20), (0, 0, 1))
    plan = replace(heights, observed=heights.observed | np.array([[1, 1, 0], [1, 1, 0], [0, 0, 0]], dtype=bool))
    free = adjust_bundle(replace(given, control=heights), datum="free", **TIGHT)
    held = adjust_bundle(replace(given, control=plan), **TIGHT)  # two points in plan: no redundancy more
    assert free.adjusted.cost == pytest.approx(held.adjusted.cost, rel=1e-9)
    rows = [3, 9, 20]
    np.testing.assert_allclose(
        free.adjusted.state[POINT][rows, 2], held.adjusted.state[POINT][rows, 2], rtol=0, atol=1e-6
    )
    moved = free.adjusted.state[POINT] + start_origin(given.poses, given.xyz_m) - given.xyz_m
    centred = given.xyz_m - given.xyz_m.mean(axis=0)
    shift, turn = moved.mean(axis=0), np.cross(centred, moved).sum(axis=0) / (centred**2).sum()
    np.testing.assert_allclose([*shift[:2], turn[2]], 0.0, atol=1e-6)


@pytest.mark.parametrize("over", ["points", "images"])
def test_gains_are_those_of_the_system_bordered_by_inner_constraints(given: Parts, over: str) -> None:
    """What an error of an image point does to its point and its image, in a block that nothing holds: Q J'."""
    result = adjust_bundle(given, datum="free", datum_over=over, **TIGHT)  # type: ignore[arg-type]
    J, columns = _all_free(result)
    H = _seven(result, columns)
    chosen = (columns[POINT] if over == "points" else columns[POSE][:, :3]).ravel()
    G = np.zeros_like(H)
    G[chosen] = H[chosen]
    everything = _bordered(J, G) @ J.T
    (gains,) = gains_of_observations(result)
    assert gains is not None
    rays = given.rays
    for group, block in ((POSE, rays.image), (POINT, rays.point)):
        expected = np.stack([everything[columns[group][b], 2 * k : 2 * k + 2] for k, b in enumerate(block)])
        found = gains.of(group)
        assert found is not None
        np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_a_result_keeps_no_copies_of_its_rays() -> None:
    """A search keeps results while it makes others: 56 bytes an image point, made again where they are asked for."""
    problem = adjust_bundle(made_bundle(), datum="free").adjusted.problem
    assert not {"ray_lane", "predicting_lane", "ray_columns"} & set(vars(problem))


@pytest.mark.parametrize(
    ("datum", "back"),
    [([4], [4]), ([2, 3], [2, 3]), ([3, 4], [2, 3, 4]), ([0], []), ([1], None)],
)
def test_where_the_datum_is_open_the_kind_of_the_fewest_rejections_that_closes_it_comes_back(
    datum: list[int], back: list[int] | None
) -> None:
    """Rays 0 and 1, positions 2 and 3, control point 4; of these a robust adjustment rejects all but the first."""
    records = SimpleNamespace(
        at_points=np.isin(np.arange(5), [0, 1, 4]),
        coordinates=np.arange(5) == 4,
        first=np.array([0, 2, 4, 5]),
        parts=[slice(0, 2), slice(2, 4), slice(4, 5)],
    )

    def solve(_: None, use: Bool) -> list[int]:
        if not use[datum].all():
            raise OpenError("open", remedy="", combinations=())
        return np.flatnonzero(use).tolist()

    of_search: Any = SimpleNamespace(all=records, _active_after_robust=lambda *_: np.arange(5) == 0, solve=solve)
    if back is None:
        with pytest.raises(OpenError):
            _Search._solved_after_robust(of_search, np.ones(5, dtype=bool), None)
    else:
        solved, _ = _Search._solved_after_robust(of_search, np.ones(5, dtype=bool), None)
        assert solved == [0, *back]  # type: ignore[comparison-overlap]
        assert np.flatnonzero(of_search.of_datum).tolist() == back


def test_nothing_comes_back_where_an_adjustment_fails_of_another_reason_than_an_open_datum() -> None:
    def solve(*_: Any) -> None:
        raise GeometryError("exact conditions contradict each other")

    active = np.ones(1, dtype=bool)
    records = SimpleNamespace(at_points=~active, coordinates=~active, first=np.array([0, 1]), parts=[slice(0, 1)])
    of_search: Any = SimpleNamespace(all=records, _active_after_robust=lambda *_: ~active, solve=solve)
    with pytest.raises(GeometryError, match="contradict"):
        _Search._solved_after_robust(of_search, active, None)


def test_an_open_datum_comes_back_from_another_process_as_it_went() -> None:
    error = pickle.loads(pickle.dumps(OpenError("open", remedy="observe", combinations=[OpenCombination("a turn")])))
    assert (str(error), error.combinations) == ("open\n    fix: observe", (OpenCombination("a turn"),))
