"""Rotations, scales and positions from a graph of pairs, against the truth they were made from."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.observations.poses import Poses
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.differences import fitted, fitted_robustly
from aatri.orientation.graph.directions import CENTRE, POINT, _across, adjusted_directions
from aatri.orientation.graph.rotations import averaged_rotations, closing_triangles
from tests.complex_step import complex_step


def ring(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Every node with the two that follow it."""
    first = np.repeat(np.arange(n), 2)
    second = (first + np.tile([1, 2], n)) % n
    return np.minimum(first, second), np.maximum(first, second)


def test_differences_give_the_values_back_and_the_first_of_each_part_is_zero() -> None:
    x = np.array([[0.0], [2.0], [5.0], [0.0], [-1.0]])
    first, second = np.array([0, 1, 0, 3]), np.array([1, 2, 2, 4])
    found = fitted(5, first, second, x[second] - x[first], np.array([1.0, 2.0, 3.0, 4.0]))
    np.testing.assert_allclose(found, x, atol=1e-12)


def test_wrong_differences_hardly_count_where_others_outvote_them() -> None:
    rng = np.random.default_rng(1)
    first, second = ring(30)
    x = rng.normal(size=(30, 2))
    d = x[second] - x[first] + rng.normal(0, 1e-3, (60, 2))
    d[[3, 17, 40]] += 5.0
    found, v = fitted_robustly(30, first, second, d, np.ones(60))
    np.testing.assert_allclose(found - found[0], x - x[0], atol=0.02)
    assert sorted(np.argsort(-v)[:3].tolist()) == [3, 17, 40]


def test_rotations_of_all_images_survive_wrong_pairs_and_the_cycle_check_names_these() -> None:
    rng = np.random.default_rng(2)
    n = 20
    left, right = ring(n)
    R = Rotation.random(n, random_state=5).as_matrix()
    pair = R[left].swapaxes(1, 2) @ R[right] @ Rotation.from_rotvec(rng.normal(0, 1e-3, (2 * n, 3))).as_matrix()
    wrong = np.array([4, 21])
    pair[wrong] = Rotation.random(2, random_state=6).as_matrix()
    triangles, closing = closing_triangles(n, left, right, pair, np.full(2 * n, 1e-3))
    assert triangles.min() >= 1
    assert (closing[wrong] == 0).all()
    share = np.maximum(closing / triangles, 0.01)
    found, error = averaged_rotations(n, left, right, pair, share)
    assert sorted(np.argsort(-error)[:2].tolist()) == wrong.tolist()
    off = Rotation.from_matrix((found[0].T @ found).swapaxes(1, 2) @ (R[0].T @ R)).magnitude()
    assert off.max() < 0.01


def test_derivatives_of_directions_are_exact() -> None:
    rng = np.random.default_rng(3)
    v = rng.normal(size=(5, 3))
    v /= np.linalg.norm(v, axis=1)[:, None]
    records = _across(v, np.arange(5), np.arange(5), 1.0)
    c, X = np.zeros((5, 3)), v * 3 + 0.4 * rng.normal(size=(5, 3))
    _, (by_c, by_X) = records.evaluate({CENTRE: c, POINT: X}, np.arange(5))
    np.testing.assert_array_equal(by_c, -by_X)
    for k in range(5):

        def residual(x: np.ndarray, k: int = k) -> np.ndarray:
            w = x / np.sqrt((x * x).sum())
            r = v[k] - (v[k] * w).sum() * w
            T = np.linalg.svd(v[k][None])[2][1:]
            return np.concatenate([T @ r, [(v[k] * r).sum()]])

        J = complex_step(residual, X[k])
        np.testing.assert_allclose(by_X[k].T @ by_X[k], J.T @ J, atol=1e-10)


@pytest.mark.parametrize("linear", [False, True])
def test_centres_and_points_follow_from_directions_up_to_shift_and_scale(linear: bool) -> None:
    rng = np.random.default_rng(4)
    c = np.column_stack([rng.uniform(-5, 5, (12, 2)), np.full(12, 3.0) + rng.normal(0, 0.2, 12)])
    X = np.column_stack([rng.uniform(-6, 6, (60, 2)), rng.normal(0, 0.3, 60)])
    image, point = (a.ravel() for a in np.meshgrid(np.arange(12), np.arange(60), indexing="ij"))
    near = np.linalg.norm(X[point, :2] - c[image, :2], axis=1) < 5
    near &= (np.bincount(point[near], minlength=60) >= 4)[point]
    image, point = image[near], np.unique(point[near], return_inverse=True)[1]
    X = X[np.unique(np.meshgrid(np.arange(12), np.arange(60), indexing="ij")[1].ravel()[near])]
    v = X[point] - c[image]
    v /= np.linalg.norm(v, axis=1)[:, None]
    start = (rng.uniform(-1, 1, c.shape), rng.uniform(-1, 1, X.shape)) if linear else (c + 0.3, X + 0.1)
    found, _ = adjusted_directions(v, image, point, *start, 1e-3, linear=linear)
    a, b = found - found.mean(axis=0), c - c.mean(axis=0)
    scale = (a * b).sum() / (a * a).sum()
    np.testing.assert_allclose(scale * a, b, atol=1e-3)


# -- components that stay apart --


def _component(image: int) -> ImageComponent:
    position = np.full((3, 3), np.nan)
    position[image] = 0.0
    return ImageComponent(Poses(np.tile(np.eye(3), (3, 1, 1)), position), np.zeros((4, 3)), np.ones(5, dtype=bool), 1.0)


def test_a_component_is_itself_whatever_its_arrays_hold() -> None:
    """A list takes the last of three out: arrays of the others that are compared have no truth value."""
    components = [_component(image) for image in range(3)]
    last = components[2]
    components.remove(last)
    assert not any(component is last for component in components)
