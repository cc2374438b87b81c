"""The compiled similarities of many pairs against the plain form of one."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import Similarity, robust_closed_form, transform
from aatri.orientation.free_block.kernels.robust_similarity import robust_similarities


def _pair(rng, n, wrong):
    x = rng.normal(size=(n, 3)) * (40.0, 9.0, 3.0) + 100.0
    truth = Similarity(rng.normal(size=3) * 50, float(rng.uniform(0.2, 3.0)), exp_rotation(rng.normal(size=3)))
    X = transform(truth, x) + rng.normal(size=(n, 3)) * 0.02
    X[:wrong] += 30.0
    return x, X


@pytest.mark.parametrize("iterations", [0, 3, 50])
def test_many_pairs_at_once_equal_each_by_itself(iterations):
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


def test_points_that_are_mirrored_are_not_fitted_by_a_mirrored_rotation():
    x, X = _pair(np.random.default_rng(6), 30, 0)
    shift, scale, rotation, distance = np.empty((1, 3)), np.empty(1), np.empty((1, 3, 3)), np.empty(30)
    robust_similarities(np.array([0, 30]), x, X * (1, 1, -1), 50, shift, scale, rotation, distance)
    assert np.linalg.det(rotation[0]) == pytest.approx(1.0)
    assert distance.max() > 1.0
