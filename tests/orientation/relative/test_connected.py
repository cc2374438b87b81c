"""Relative orientation with the condition of model connection."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.geometry.intersection import intersect_pair
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.connected import Before, _connection, connected_orientation
from tests.orientation.relative.pairs import relative_orientation, rotation, simulate


def triplet(seed: int, noisy: bool, per_place: int = 4) -> Any:
    """Three images in a row; points of both models lie across the strip at the second image."""
    rng = np.random.default_rng(seed)
    centres = np.array([[0.0, 0, 0], [0.6, 0.02, 0.01], [1.32, -0.03, 0.02]])
    turns = [rotation(rng) for _ in range(3)]
    places = np.array([[x, y, -1.0] for x in (0.0, 0.6, 1.3) for y in (0.0, 0.5, -0.5)])
    X = np.repeat(places, per_place, axis=0)
    X = X + np.column_stack([rng.uniform(-0.08, 0.08, (len(X), 2)), rng.uniform(-0.05, 0.05, len(X))])
    in_a, in_b = np.flatnonzero(X[:, 0] < 0.9), np.flatnonzero(X[:, 0] > 0.3)
    noise = rng if noisy else None
    a, *_ = simulate(X[in_a], turns[0], turns[1], centres[0], centres[1], noise)
    b, R, base = simulate(X[in_b], turns[1], turns[2], centres[1], centres[2], noise)
    if noisy:  # the common image is measured once
        same = np.searchsorted(in_a, np.intersect1d(in_a, in_b)), np.searchsorted(in_b, np.intersect1d(in_a, in_b))
        b.left[same[1]] = a.right[same[0]]
    model = relative_orientation(a)
    common = np.intersect1d(in_a, in_b)
    at_a, at_b = np.searchsorted(in_a, common), np.searchsorted(in_b, common)
    before = Before(
        model.left_from_right, model.base, model.covariance, at_b, model.points.xyz[at_a], model.points.covariance[at_a]
    )
    scale = np.linalg.norm(centres[2] - centres[1]) / np.linalg.norm(centres[1] - centres[0])
    return b, before, R, base, float(scale)


def test_error_free_coordinates_give_the_true_orientation_and_scale() -> None:
    rays, before, R, base, scale = triplet(1, noisy=False)
    start = exp_rotation(np.array([1e-3, 2e-3, -1e-3])) @ R
    found = connected_orientation(rays, np.ones(len(rays.left), bool), start, base, before)
    assert found is not None
    assert found.left_from_right == pytest.approx(R, abs=1e-9)
    assert found.base == pytest.approx(base, abs=1e-9)
    assert found.scale == pytest.approx(scale, rel=1e-9)


def test_derivatives_of_the_latent_errors_are_those_of_the_model_before() -> None:
    """An orientation of model a that is wrong by x_a gives distances wrong by J_a x_a, and s too large by them."""
    rays, before, R, base, _ = triplet(2, noisy=False)
    observed, sigma, by_latent = _connection(rays, R, base, before)
    assert np.ptp(observed) < 1e-9  # error-free: one scale for all points
    assert by_latent.shape == (len(before.row), 5)
    assert (sigma > 0).all()


@pytest.mark.slow
def test_scale_and_orientation_scatter_as_their_sigmas_say() -> None:
    normalised, sigma0 = [], []
    for seed in range(150):
        rays, before, R, base, scale = triplet(seed, noisy=True)
        plain = relative_orientation(rays)
        found = connected_orientation(rays, plain.active, plain.left_from_right, plain.base, before, limit=100.0)
        assert found is not None
        turn = found.left_from_right @ R.T
        d = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        t = tangents(base).T @ (found.base - base)
        e = np.concatenate([d, t])
        normalised.append(
            [e @ np.linalg.solve(found.covariance, e) / 5, ((found.scale - scale) / found.scale_sigma) ** 2]
        )
        sigma0.append(found.sigma0**2)
        assert np.trace(found.covariance) <= np.trace(plain.covariance) * (1 + 1e-3)
    mean = np.mean(normalised, axis=0)
    # chi-square over its freedom: sigma sqrt(2 / (freedom 150)); what the common image correlates is left out
    assert mean[0] == pytest.approx(1.0, abs=4 * np.sqrt(2 / (5 * 150)) + 0.1)
    assert mean[1] == pytest.approx(1.0, abs=4 * np.sqrt(2 / 150) + 0.1)
    assert np.mean(sigma0) == pytest.approx(1.0, abs=0.15)


def test_a_wrong_connection_point_is_rejected_in_p_and_named() -> None:
    rays, before, R, base, scale = triplet(4, noisy=True)
    before.xyz[5] = before.base + 1.1 * (before.xyz[5] - before.base)
    found = connected_orientation(rays, np.ones(len(rays.left), bool), R, base, before)
    assert found is not None
    assert np.flatnonzero(~found.connects).tolist() == [5]
    assert found.scale == pytest.approx(scale, rel=2e-3)
    assert abs(found.size[5]) == pytest.approx(np.log(1.1), rel=0.1)


def test_with_too_few_connection_points_there_is_no_connection() -> None:
    rays, before, R, base, _ = triplet(4, noisy=False)
    few = Before(
        before.left_from_right,
        before.base,
        before.covariance,
        before.row[:2],
        before.xyz[:2],
        before.point_covariance[:2],
    )
    assert connected_orientation(rays, np.ones(len(rays.left), bool), R, base, few) is None
    assert intersect_pair(R, base, rays).xyz.shape == (len(rays.left), 3)
