"""Over a plane each pair has two orientations: an expected rotation decides, or the planes of neighbouring pairs."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.essential import essential_orientations
from aatri.orientation.relative.shared_planes import rotations_by_planes
from tests.campaigns.essential import errors, rays_of, trial

C_MM, SIGMA_MM = 9.0, 0.005


def off_rad(a: Any, b: Any) -> float:
    """Angle between two rotations."""
    return float(Rotation.from_matrix(a @ b.T).magnitude())


@pytest.mark.parametrize("error_deg", [0.0, 2.0])
def test_an_expected_rotation_decides_between_two_orientations_over_a_plane(error_deg: float) -> None:
    rng = np.random.default_rng(5)
    trials = [trial(rng, noise=1.0, planar=True) for _ in range(60)]
    turn = Rotation.from_rotvec(np.radians(error_deg) * np.array([0.6, -0.8, 0.0])).as_matrix()
    expected = np.array([turn @ t.rotation for t in trials])
    undecided = np.isfinite(essential_orientations(*rays_of(trials)).second[:, 0, 0])
    made = essential_orientations(*rays_of(trials), expected=expected)
    assert undecided.sum() > 5
    _, ratio = errors(trials, made.orientations)
    decided = ~np.isfinite(made.second[:, 0, 0])
    assert decided[undecided].mean() > 0.9
    assert (ratio[undecided & decided] < 6).all()


def test_a_wrong_expected_rotation_decides_nothing() -> None:
    """Both orientations are far off it: the better fit stays first, the other beside it."""
    rng = np.random.default_rng(5)
    trials = [trial(rng, noise=1.0, planar=True) for _ in range(60)]
    alone = essential_orientations(*rays_of(trials))
    turned = Rotation.from_rotvec([0.0, 0.0, 3.0]).as_matrix()
    made = essential_orientations(*rays_of(trials), expected=np.array([turned @ t.rotation for t in trials]))
    np.testing.assert_array_equal(np.isfinite(made.second), np.isfinite(alone.second))
    np.testing.assert_array_equal(made.orientations.left_from_right, alone.orientations.left_from_right)


def flat_block(rng: np.random.Generator) -> tuple[Any, Any, Any, RayPairs, Any]:
    """Six images over flat ground in two rows, few points: pairs, true rotations and the rays of their points."""
    centre = np.array([[4.0 * i, 6.0 * j, 10.0] for j in (0, 1) for i in (0, 1, 2)]) + rng.normal(0, 0.3, (6, 3))
    R = Rotation.from_rotvec(rng.normal(0, 0.03, (6, 3))).as_matrix()
    X = np.column_stack([rng.uniform(-3, 11, 90), rng.uniform(-4, 10, 90), np.zeros(90)])
    u = np.einsum("kji,knj->kni", R, X[None] - centre[:, None])
    xy = -C_MM * u[:, :, :2] / u[:, :, 2:] + rng.normal(0, SIGMA_MM, (6, 90, 2))
    inside = (np.abs(xy) < [5.4, 4.05]).all(axis=2)
    pairs = [(a, b) for a, b in combinations(range(6), 2) if (inside[a] & inside[b]).sum() >= 8]
    rows = [np.flatnonzero(inside[a] & inside[b]) for a, b in pairs]
    left, right = (np.concatenate([xy[p[k]][r] for p, r in zip(pairs, rows)]) for k in (0, 1))
    z, sigma = np.full(len(left), -C_MM), np.full((len(left), 2), SIGMA_MM)
    rays = RayPairs(np.column_stack([left, z]), np.column_stack([right, z]), sigma, sigma)
    of = np.array(pairs)
    true = R[of[:, 0]].swapaxes(1, 2) @ R[of[:, 1]]
    return of[:, 0], of[:, 1], true, rays, np.concatenate([[0], np.cumsum([len(r) for r in rows])])


def test_neighbouring_pairs_that_see_the_same_plane_decide() -> None:
    wrong_before = 0
    for seed in range(12):
        left, right, true, rays, start = flat_block(np.random.default_rng(seed))
        made = essential_orientations(rays, start)
        chosen, exchanged = rotations_by_planes(left, right, rays, start, made)
        first, second = made.orientations.left_from_right, made.second[:, :, :3]
        told = np.flatnonzero(np.isfinite(chosen[:, 0, 0])).tolist()
        assert np.isfinite(second[told]).all()
        assert exchanged == sum(not np.array_equal(chosen[k], first[k]) for k in told)
        for k in told:
            assert off_rad(chosen[k], true[k]) <= min(off_rad(first[k], true[k]), off_rad(second[k], true[k]))
        mended = [k for k in told if off_rad(first[k], true[k]) > 0.2]
        assert all(off_rad(chosen[k], true[k]) < 0.2 for k in mended)
        wrong_before += len(mended)
    assert wrong_before > 2


def test_a_pair_by_itself_is_not_decided() -> None:
    trials = [trial(np.random.default_rng(5), noise=1.0, planar=True) for _ in range(30)]
    rays, start = rays_of(trials)
    made = essential_orientations(rays, start)
    left = 2 * np.arange(30)
    chosen, exchanged = rotations_by_planes(left, left + 1, rays, start, made)
    assert exchanged == 0
    assert np.isnan(chosen).all()
