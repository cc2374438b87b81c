"""Relative orientation without start: seeded trials, planes, images without base; the compiled five-point solver."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.geometry.coplanarity import RayPairs, essential_matrix
from aatri.orientation.relative import essential
from aatri.orientation.relative.essential import essential_orientations
from aatri.orientation.relative.kernels import hypotheses
from aatri.orientation.relative.kernels.five_point import REAL_ROOTS, five_point, roots_within_one
from aatri.orientation.relative.kernels.plane_twin import twin
from aatri.orientation.relative.orientations import RelativeOrientations
from tests.campaigns.essential import campaign, errors, rays_of, trial
from tests.orientation.relative.five_point import five_point as in_numpy
from tests.orientation.relative.pairs import gruber_ground, rotation, simulate
from tests.orientation.relative.pairs import rays_of as rays_of_pair


@pytest.mark.parametrize("planar", [False, True])
def test_the_compiled_five_point_solver_finds_what_the_action_matrix_finds(planar: bool) -> None:
    rng = np.random.default_rng(4)
    for _ in range(40):
        t = trial(rng, noise=0.0, planar=planar)
        u1, u2 = (np.column_stack([xy, np.full(len(xy), -8.8)])[:5] / 10 for xy in (t.left, t.right))
        E = np.empty((REAL_ROOTS, 3, 3))
        found = E[: five_point(u1, u2, np.arange(5), E)]
        truth = essential_matrix(t.rotation, t.base)
        assert min(min(np.abs(e - truth).max(), np.abs(e + truth).max()) for e in found) < 1e-6
        others = in_numpy(u1[None], u2[None])
        assert len(found) == len(others)
        for e in others:  # over a plane the coefficients of det B lose five digits and more, those of a start
            assert min(min(np.abs(e - f).max(), np.abs(e + f).max()) for f in found) < (1e-4 if planar else 1e-5)


def test_a_root_at_which_the_polynomial_is_exactly_zero_is_found_there() -> None:
    """Of x^3 - x/4 the middle between the extrema is a root; the middle of what is above it was given instead."""
    roots = np.empty(5)
    assert roots_within_one(np.array([0.0, -0.25, 0.0, 1.0]), 3, roots) == 3
    np.testing.assert_allclose(roots[:3], [-0.5, 0.0, 0.5], atol=1e-15)


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_every_trial_with_base_over_depth_from_a_tenth_to_one_ends_at_the_truth(noise: float) -> None:
    found = campaign(100, noise, 0.0, seed=11)
    assert found["at the truth"] == 100
    assert found["of these called ambiguous"] == 0


def test_a_third_of_wrong_points_is_survived_and_no_wrong_orientation_goes_untold() -> None:
    found = campaign(100, 1.0, 0.3, seed=12)
    assert found["at the truth"] >= 99
    assert found["wrong and not told"] == 0


def test_over_a_plane_every_wrong_orientation_is_called_ambiguous_and_the_second_is_the_truth() -> None:
    rng = np.random.default_rng(5)
    trials = [trial(rng, noise=1.0, planar=True) for _ in range(100)]
    made = essential_orientations(*rays_of(trials))
    _, ratio = errors(trials, made.orientations)
    wrong = ratio > 6
    assert wrong.any()
    assert np.isfinite(made.second[wrong]).all()
    for k in np.flatnonzero(wrong).tolist():
        assert Rotation.from_matrix(made.second[k, :, :3] @ trials[k].rotation.T).magnitude() < 0.05
        assert any("ambiguous" in text for text in made.orientations.warnings[k])


def test_orientations_are_rotations_to_the_last_digits() -> None:
    rng = np.random.default_rng(5)
    for planar in (False, True):
        made = essential_orientations(*rays_of([trial(rng, noise=1.0, planar=planar) for _ in range(100)]))
        R = made.orientations.left_from_right[made.orientations.formed]
        assert np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max() < 1e-12


def test_the_other_orientation_over_a_plane_maps_it_the_same_way() -> None:
    rng = np.random.default_rng(6)
    R, b, m = Rotation.random(random_state=3).as_matrix(), rng.normal(size=3), rng.normal(size=3)
    b /= np.linalg.norm(b)
    other = np.empty((3, 4))
    assert twin(np.column_stack([R, b]), m, other)
    X = rng.normal(size=(6, 3))
    X /= (X @ m)[:, None]
    u1, u2 = X, (X - b) @ R
    F = np.einsum("ni,ij,nj->n", u1, essential_matrix(other[:, :3], other[:, 3]), u2)
    np.testing.assert_allclose(F, 0, atol=1e-12)
    np.testing.assert_allclose(other[:, :3] @ other[:, :3].T, np.eye(3), atol=1e-12)
    assert np.abs(other[:, 3] - b).max() > 0.01


def test_images_without_base_make_no_model_but_their_rotation_is_known() -> None:
    rng = np.random.default_rng(7)
    R = Rotation.from_euler("xyz", [0.1, -0.05, 1.2]).as_matrix()
    u = np.column_stack([rng.uniform(-50, 50, (40, 2)), np.full(40, -153.84)])
    w = u @ R
    right = -153.84 * w[:, :2] / w[:, 2:] + rng.normal(0, 0.005, (40, 2))
    pair = rays_of_pair(u[:, :2], right)
    made = essential_orientations(pair, np.array([0, 40]))
    assert not made.orientations.formed[0]
    assert "no base" in made.orientations.reasons[0]
    assert Rotation.from_matrix(made.turned[0] @ R.T).magnitude() < 5 * made.turned_sigma_rad[0] < 1e-3
    assert made.turned_points[0] >= 38


@pytest.mark.parametrize(
    ("change", "why"),
    [("few", "4 common points"), ("line", "line"), ("same", "identical"), ("wrong", "points fit")],
)
def test_a_pair_that_cannot_be_oriented_says_why(change: str, why: str) -> None:
    rng = np.random.default_rng(8)
    t = trial(rng, noise=1.0)
    left, right = t.left[:30].copy(), t.right[:30].copy()
    if change == "few":
        left, right = left[:4], right[:4]
    elif change == "line":
        left[:, 1] = right[:, 1] = 0.2
    elif change == "same":
        right = left
    else:
        right = rng.permutation(right)
    z, sigma = np.full(len(left), -8.8), np.full((len(left), 2), 0.0012)
    pair = RayPairs(np.column_stack([left, z]), np.column_stack([right, z]), sigma, sigma)
    made = essential_orientations(pair, np.array([0, len(left)]))
    assert not made.orientations.formed[0]
    assert why in made.orientations.reasons[0]


@pytest.mark.parametrize("planar", [False, True])
def test_five_point_solutions_satisfy_the_definition_and_hold_the_truth(planar: bool) -> None:
    rng = np.random.default_rng(3)
    R, b, u1, u2 = _pair(rng, 5, planar)
    E = np.empty((REAL_ROOTS, 3, 3))
    E = E[: five_point(u1, u2, np.arange(5), E)]
    assert 1 <= len(E) <= 10
    for e in E:
        assert abs(np.linalg.det(e)) < 1e-8
        np.testing.assert_allclose(2 * e @ e.T @ e - np.trace(e @ e.T) * e, 0, atol=1e-8)
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", u1, e, u2), 0, atol=1e-9)
    truth = essential_matrix(R, b)
    assert min(min(np.abs(e - truth).max(), np.abs(e + truth).max()) for e in E) < 1e-8


def _pair(rng: np.random.Generator, n: int, planar: bool = False) -> tuple[np.ndarray, ...]:
    """Points in front of two images; the right one is turned at random."""
    R = Rotation.from_rotvec(rng.normal(size=3) * 0.3).as_matrix()
    b = rng.normal(size=3)
    b /= np.linalg.norm(b)
    X = np.column_stack([rng.uniform(-1, 1, (n, 2)) * 2, np.full(n, -3.0) if planar else rng.uniform(-4, -2.5, n)])
    return R, b, X, (X - b) @ R


def test_half_of_the_points_wrong_is_survived() -> None:
    rng = np.random.default_rng(8)
    R, b, u1, u2 = _pair(rng, 60)
    left, right = (-100 * u[:, :2] / u[:, 2:] for u in (u1, u2))
    assert (u2[:, 2] < 0).all()
    right[:30] += rng.uniform(-40, 40, (30, 2))
    found = essential_orientations(rays_of_pair(left, right, c=100.0), np.array([0, 60])).orientations
    np.testing.assert_allclose(found.left_from_right[0], R, atol=1e-6)
    np.testing.assert_allclose(found.base[0], b, atol=1e-6)


def test_over_flat_ground_the_orientation_with_the_points_in_front_comes_first() -> None:
    """A plane has a second orientation, often with points behind, that explains the rays of noisy points as well."""
    rng = np.random.default_rng(3)
    for _ in range(25):
        X = gruber_ground(6, rng, relief=0.0)
        rays, R, b = simulate(X, rotation(rng), rotation(rng), np.zeros(3), np.array([0.6, 0.02, -0.01]), rng)
        found = essential_orientations(rays, np.array([0, len(X)])).orientations
        assert np.abs(found.left_from_right[0] - R).max() < 0.1
        assert found.base[0] @ b > 0.9


def test_a_hypothesis_is_judged_by_cauchys_cost_of_all_distances() -> None:
    """sum log(1 + (v / 3)^2), v with the variance of F by the coordinates; a bound that is exceeded ends it."""
    rng = np.random.default_rng(8)
    E, left, right = rng.normal(size=(3, 3)), rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    variance = rng.uniform(0.1, 0.3, (6, 4))
    v, by_left, by_right = np.empty(6), right @ E.T, left @ E
    spread = (variance[:, :2] * by_left[:, :2] ** 2).sum(axis=1) + (variance[:, 2:] * by_right[:, :2] ** 2).sum(axis=1)
    wanted = np.einsum("ni,ni->n", left, by_left) / np.sqrt(spread)
    cost = hypotheses.judge(E, np.hstack([left, right, variance]), np.inf, v)
    np.testing.assert_allclose(v, wanted, rtol=1e-12)
    assert cost == pytest.approx(np.log1p((wanted / 3.0) ** 2).sum(), rel=1e-12)
    assert hypotheses.judge(E, np.hstack([left, right, variance]), 0.9 * cost, v) == np.inf


@pytest.mark.slow
def test_pairs_of_which_most_are_weak_are_not_all_oriented_with_every_multiple(monkeypatch: pytest.MonkeyPatch) -> None:
    """100 good pairs and 1,400 of four points: a sample tells that the standard deviations are no cause."""
    rays, _ = rays_of([trial(np.random.default_rng(3), noise=1.0)])
    n, counts = len(rays.left), list[int]()
    rays = rays.take(np.concatenate([np.tile(np.arange(n), 100), np.tile(np.arange(4), 1400)]))
    start = np.concatenate([[0], np.cumsum([n] * 100 + [4] * 1400)])
    oriented_from = essential.oriented_from

    def counted(rays: RayPairs, start: np.ndarray, *rest: Any) -> RelativeOrientations:
        counts.append(len(start) - 1)
        return oriented_from(rays, start, *rest)

    monkeypatch.setattr(essential, "oriented_from", counted)
    made = essential_orientations(rays, start)
    assert made.orientations.scale == 1.0
    np.testing.assert_array_equal(made.orientations.formed, np.arange(1500) < 100)
    np.testing.assert_array_equal(made.samples > 0, made.orientations.formed)
    assert len(counts) > 2
    assert sum(counts) < 3 * 1500
