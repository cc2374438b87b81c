"""The compiled similarities of many pairs against the plain form of one."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import Similarity, robust_closed_form, transform
from aatri.orientation.bodies.components import _medians
from aatri.orientation.bodies.kernels.robust_similarity import robust_similarities
from aatri.orientation.bodies.similarity_ties import spectrum_of


def _pair(rng: np.random.Generator, n: int, wrong):
    x = rng.normal(size=(n, 3)) * (40.0, 9.0, 3.0) + 100.0
    truth = Similarity(rng.normal(size=3) * 50, float(rng.uniform(0.2, 3.0)), exp_rotation(rng.normal(size=3)))
    X = transform(truth, x) + rng.normal(size=(n, 3)) * 0.02
    X[:wrong] += 30.0
    return x, X


@pytest.mark.parametrize("iterations", [0, 3, 50])
def test_many_pairs_at_once_equal_each_by_itself(iterations: int) -> None:
    rng = np.random.default_rng(5)
    pairs = [_pair(rng, n, wrong) for n, wrong in ((3, 0), (4, 1), (60, 15), (7, 0), (200, 1))]
    x, X = (np.concatenate(side) for side in zip(*pairs))
    start = np.cumsum([0, *(len(p[0]) for p in pairs)]).astype(np.int64)
    shift, scale, rotation, distance = np.empty((5, 3)), np.empty(5), np.empty((5, 3, 3)), np.empty(len(x))
    robust_similarities(start, x, X, iterations, shift, scale, rotation, distance)
    for k, pair in enumerate(pairs):
        one, of_each = robust_closed_form(*pair, iterations=iterations)
        np.testing.assert_allclose(rotation[k], one.rotation, atol=1e-11)
        np.testing.assert_allclose(scale[k], one.scale, rtol=1e-11)
        np.testing.assert_allclose(shift[k], one.translation, atol=1e-8)
        np.testing.assert_allclose(distance[start[k] : start[k + 1]], of_each, atol=1e-9)


def test_points_that_are_mirrored_are_not_fitted_by_a_mirrored_rotation() -> None:
    x, X = _pair(np.random.default_rng(6), 30, 0)
    shift, scale, rotation, distance = np.empty((1, 3)), np.empty(1), np.empty((1, 3, 3)), np.empty(30)
    robust_similarities(np.array([0, 30]), x, X * (1, 1, -1), 50, shift, scale, rotation, distance)
    assert np.linalg.det(rotation[0]) == pytest.approx(1.0)
    assert distance.max() > 1.0


def test_eigenvalues_and_vectors_are_those_of_numpy_also_of_singular_and_equal_ones() -> None:
    rng = np.random.default_rng(7)
    half = rng.normal(size=(300, 3, 3)) * np.array([1e-4, 1.0, 30.0])
    C = half @ half.swapaxes(1, 2)
    C[0], C[1], C[2], C[3] = 0.0, 2.5 * np.eye(3), np.ones((3, 3)), np.diag([3.0, 0.0, 1e-20])
    values, vectors = spectrum_of(C)
    scale = np.linalg.norm(C, axis=(1, 2))[:, None]
    assert (np.abs(np.sort(values, axis=1) - np.linalg.eigvalsh(C)) <= 1e-14 * scale).all()
    np.testing.assert_allclose(vectors.swapaxes(1, 2) @ vectors, np.tile(np.eye(3), (300, 1, 1)), atol=1e-14)
    again = (vectors * values[:, None]) @ vectors.swapaxes(1, 2)
    assert (np.abs(again - C) <= 1e-13 * scale[:, None]).all()


def test_medians_of_points_in_any_number_of_strips() -> None:
    rng = np.random.default_rng(8)
    count = np.array([1, 2, 3, 4, 1, 7, 2, 5])
    point = np.repeat(np.arange(8), count)
    value = rng.normal(size=len(point))
    wanted = [np.median(value[point == p]) for p in range(8)]
    np.testing.assert_allclose(_medians(point, value, count), wanted, rtol=1e-13)


def test_the_spectrum_of_a_view_of_one_covariance() -> None:
    """As of one projection centre: a view that cannot be written to."""
    values, vectors = spectrum_of(np.broadcast_to(4.0 * np.eye(3), (1, 3, 3)))
    np.testing.assert_allclose(values, 4.0)
    np.testing.assert_allclose(vectors[0] @ vectors[0].T, np.eye(3), atol=1e-15)
