"""Scale transfer and the chain of models."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from aatri.orientation.strips.chain import form_strips
from aatri.orientation.strips.joints import scale_transfers
from tests.orientation.strips.reference import Model
from tests.orientation.strips.tables import table_of

sys.path.insert(0, str(Path(__file__).parent))
from tests.orientation.relative.pairs import image_coordinates, rays_of, relative_orientation, rotation


def _strip(rng: np.random.Generator, n_images, kappa=0.0, density=3):
    """Images along x with uneven bases and heights, points on relief; models from relative orientation."""
    X0 = np.column_stack(
        [0.55 * np.arange(n_images) + rng.normal(0, 0.02, n_images), rng.normal(0, 0.02, (n_images, 2))]
    )
    R = [rotation(rng, kappa=kappa) for _ in X0]
    x = np.repeat(0.55 * np.arange(n_images), 3 * density)
    y = np.tile(np.repeat([-0.55, 0, 0.55], density), n_images)
    ground = np.column_stack([x, y, -np.ones_like(x)]) + rng.uniform(-0.08, 0.08, (len(x), 3))
    return X0, R, ground, np.array([image_coordinates(ground, X0[i], R[i]) for i in range(n_images)])


def _models(X0, R, ground, image_points):
    models = []
    for i in range(len(X0) - 1):
        left, right = image_points[i], image_points[i + 1]
        common = np.flatnonzero((np.abs(left) < 115).all(axis=1) & (np.abs(right) < 115).all(axis=1))
        found = relative_orientation(rays_of(left[common], right[common]), snooping_limit=6.0)
        use = found.active
        models.append(
            Model(
                found.left_from_right,
                found.base,
                found.covariance,
                common[use],
                found.points.xyz[use],
                found.points.covariance[use],
            )
        )
    return models


@pytest.mark.parametrize("kappa", [0.0, np.pi, np.pi / 2])
def test_an_error_free_strip_is_reproduced_exactly(kappa) -> None:
    X0, R, ground, xy = _strip(np.random.default_rng(1), 6, kappa=kappa)
    models = _models(X0, R, ground, xy)
    table = table_of(models)
    together = scale_transfers(table, np.arange(4), np.arange(1, 5))
    strip = form_strips(table, together, [(range(5), range(4))])
    base = np.linalg.norm(X0[1] - X0[0])
    np.testing.assert_allclose(strip.position, (X0 - X0[0]) @ R[0] / base, atol=1e-11)
    np.testing.assert_allclose(strip.strip_from_image, [R[0].T @ r for r in R], atol=1e-11)
    np.testing.assert_allclose(strip.xyz, (ground[strip.point] - X0[0]) @ R[0] / base, atol=1e-10)
    lengths = np.linalg.norm(np.diff(X0, axis=0), axis=1)
    np.testing.assert_allclose(together.scale, lengths[1:] / lengths[:-1], atol=1e-12)
    assert together.active.all()
    assert np.abs(strip.placed[together.first_row] - strip.placed[together.second_row]).max() < 1e-10


@pytest.mark.slow
def test_scale_and_discrepancies_have_the_spread_their_sigmas_say() -> None:
    rng = np.random.default_rng(7)
    X0, R, ground, xy = _strip(rng, 3)
    true = np.linalg.norm(X0[2] - X0[1]) / np.linalg.norm(X0[1] - X0[0])
    tests, errors = [], []
    for _ in range(100):
        models = _models(X0, R, ground, xy + rng.normal(0, 0.005, xy.shape))
        joint = scale_transfers(table_of(models), np.array([0]), np.array([1]))
        assert joint.active.all() or (~joint.active).sum() <= 1
        tests.append(joint.test)
        errors.append((joint.scale[0] - true) / joint.sigma[0])
    assert np.std(errors) == pytest.approx(1.0, abs=0.25)
    assert np.sqrt(np.mean(np.concatenate(tests) ** 2)) == pytest.approx(1.0, abs=0.1)


def test_a_connection_point_wrong_in_x_is_found_and_left_out() -> None:
    rng = np.random.default_rng(9)
    X0, R, ground, xy = _strip(rng, 4)
    xy = xy + rng.normal(0, 0.005, xy.shape)
    wrong = 12
    xy[2, wrong, 0] += 0.15
    models = _models(X0, R, ground, xy)
    table = table_of(models)
    together = scale_transfers(table, np.arange(2), np.arange(1, 3))
    out = (together.of_row() == 0) & ~together.active
    assert table.point[together.first_row[out]].tolist() == [wrong]
    assert (together.test[out] > 4).all()
    assert wrong not in form_strips(table, together, [(range(3), range(2))]).point
    assert wrong in form_strips(table, together, [([0], []), ([1, 2], [1])]).point  # where the joint is not used
