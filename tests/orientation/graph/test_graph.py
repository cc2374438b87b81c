"""Rotations, scales and positions from a graph of pairs, against the truth they were made from."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import ConvergenceError
from aatri.geometry.similarity import transform
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.graph import component
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.component_bodies import principal_distance_shares
from aatri.orientation.graph.differences import fitted, fitted_robustly
from aatri.orientation.graph.directions import CENTRE, POINT, _across, adjusted_directions
from aatri.orientation.graph.few_points import by_few_points
from aatri.orientation.graph.joining import _by_images
from aatri.orientation.graph.limits import FREE_DISTANCE_SHARE
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
    misfit, (_, of_behind) = records.evaluate({CENTRE: c, POINT: -X}, np.arange(5))
    np.testing.assert_array_equal(np.abs(misfit), np.tile([0.0, 0.0, 1.0], (5, 1)))
    np.testing.assert_array_equal(of_behind, 0.0)  # whatever lies behind misses by all there is


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


STRIPS, SHIFT, TURN = (
    np.repeat([0, 1], 3),
    np.array([5.0, -3.0, 2.0]),
    Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix(),
)


def _two_strips(wrong: bool, common: int) -> tuple[ImageComponent, ImageComponent, ImagePointRows, np.ndarray]:
    """Two strips of three images 100 over the ground, and projection centres of the second in the frame of the first.

    `common` points in a row between them are in both, two beside it once in the other strip; in this another object
    carries the number of the first if `wrong`.
    """
    centre = np.array([[60.0 * k, 90.0 * s, 100.0] for s in (0, 1) for k in (0, 1, 2)])
    rng = np.random.default_rng(6)
    row = np.column_stack([np.linspace(10.0, 110.0, 5), 45.0 + rng.uniform(-0.2, 0.2, 5), rng.uniform(-5.0, 5.0, 5)])
    ground = np.vstack(
        [row[:common], [[35.0, 20.0, 3.0], [85.0, 18.0, -2.0]], rng.uniform([0, -60, 0], [120, -40, 5], (4, 3))]
    )
    in_first, in_second = np.arange(len(ground)), np.array([*range(common)])
    seen = [(k, p) for k in (0, 1, 2) for p in in_first] + [(k, p) for k in (3, 4, 5) for p in in_second]
    seen += [(4, common), (4, common + 1)]
    image, point = np.array(seen).T
    there = ground[point] + np.where(wrong & (image > 2) & (point == 0), 200.0, 0.0)[:, None] * [0.5, 1.0, 0.0]
    ray = there - centre[image]
    xy_mm = -150.0 * ray[:, :2] / ray[:, 2:]
    n = len(image)
    rays = ImagePointRows(
        image, point, xy_mm, np.full((n, 2), 0.005), np.full(n, 150.0), np.zeros((n, 2)), np.ones(n, dtype=bool)
    )
    xyz = np.full((2, *ground.shape), np.nan)
    xyz[0], xyz[1, in_second] = ground, ground[in_second]
    xyz[1, 0] += 200.0 * wrong * np.array([0.5, 1.0, 0.0])
    upright = np.tile(np.eye(3), (6, 1, 1))
    base = ImageComponent(Poses(centre, upright).where(STRIPS == 0), xyz[0], STRIPS[image] == 0, 1.0)
    free = Poses(0.1 * centre @ TURN.T + SHIFT, TURN @ upright).where(STRIPS == 1)
    kept = (STRIPS[image] == 1) & (point < common)
    return base, ImageComponent(free, 0.1 * xyz[1] @ TURN.T + SHIFT, kept, 1.0), rays, centre


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("wrong", [False, True])
def test_strips_are_joined_by_fewer_points_than_locate_a_wrong_one(wrong: bool) -> None:
    """Points in a row leave the turn about it open, which two rays to points of the first strip alone give."""
    base, other, rays, centre = _two_strips(wrong, 5)
    fit = by_few_points(base, other, rays, 15, 0.4)
    assert fit is not None
    similarity, points = fit
    assert points == (6 if wrong else 7)
    np.testing.assert_allclose(transform(similarity, other.poses.position_m[3:]), centre[3:], atol=1e-4)


@pytest.mark.parametrize(("common", "wrong", "fitting"), [(2, False, 2), (5, True, 4), (2, True, 0)])
def test_a_common_image_and_the_distances_of_points_from_it_join_strips(common: int, wrong: bool, fitting: int) -> None:
    base, other, _, centre = _two_strips(wrong, common)
    poses = Poses(0.1 * centre @ TURN.T + SHIFT, np.tile(TURN, (6, 1, 1))).where(np.arange(6) >= 2)
    fit = _by_images(base, replace(other, poses=poses))
    assert (0 if fit is None else fit[1]) == fitting
    if fit is not None:
        np.testing.assert_allclose(transform(fit[0], poses.position_m[2:]), centre[2:], atol=1e-9)


def test_strips_with_too_few_rays_between_them_stay_apart() -> None:
    base, other, rays, _ = _two_strips(False, 3)  # 3 x 3 and 2 x 2 conditions
    assert by_few_points(base, other, rays, 15, 0.4) is None


def test_strips_with_common_points_on_a_line_alone_stay_apart() -> None:
    """Five points are fifteen conditions, which leave the turn about their line open."""
    base, other, rays, _ = _two_strips(False, 5)
    line = (base.xyz[4] - base.xyz[0]) * np.linspace(0.0, 1.0, 5)[:, None] + base.xyz[0]
    rays = replace(rays, active=rays.point < 5)
    on_line = [replace(base, xyz=np.vstack([line, base.xyz[5:]]))]
    on_line.append(replace(other, xyz=np.vstack([0.1 * line @ TURN.T + SHIFT, other.xyz[5:]])))
    seen = line[rays.point[rays.point < 5]]
    ray = seen - _two_strips(False, 5)[3][rays.image[rays.point < 5]]
    xy_mm = rays.xy_mm.copy()
    xy_mm[rays.point < 5] = -150.0 * ray[:, :2] / ray[:, 2:]
    assert by_few_points(*on_line, replace(rays, xy_mm=xy_mm), 15, 0.4) is None


def test_strips_whose_common_points_coincide_stay_apart() -> None:
    base, other, rays, _ = _two_strips(False, 3)
    at_one_place = replace(base, xyz=np.where(np.arange(len(base.xyz))[:, None] < 3, base.xyz[0], base.xyz))
    assert by_few_points(at_one_place, other, rays, 3, 0.4) is None


class _Cameras:
    principal_distance_mm = np.full(4, 100.0)

    def __len__(self) -> int:
        return len(self.principal_distance_mm)


def test_principal_distances_of_single_images_are_off_together_and_those_of_several_each_by_itself() -> None:
    """Cameras of one, one, two and three images; c is known to 1 mm of 100, not at all, exactly, to 2 mm."""
    of_image = np.array([0, 1, 2, 2, 3, 3, 3])
    parameters = SimpleNamespace(
        name=np.array(["principal_distance", "k1", "principal_distance", "principal_distance"]),
        camera=np.array([0, 2, 1, 3]),
        sigma=np.array([1.0, 5.0, np.nan, 2.0]),
        free=np.array([False, True, True, False]),
    )
    block = SimpleNamespace(cameras=_Cameras(), images=SimpleNamespace(camera=of_image), camera_parameters=parameters)
    shares = principal_distance_shares(cast(Any, block), cast(Any, SimpleNamespace(image=np.arange(7))))
    np.testing.assert_allclose(shares, [[0.01, FREE_DISTANCE_SHARE, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.02, 0.02, 0.02]])


def test_a_component_that_does_not_settle_begins_once_more_without_the_rays_farther_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One mirrored image, whose rays lie within the wide limit, keeps all others from converging."""
    limits = list[float | None]()

    def refined(*arguments: Any) -> str:
        limits.append(arguments[4][0])
        if len(limits) == 1:
            raise ConvergenceError("no convergence")
        return "the others"

    monkeypatch.setattr(component, "refined", refined)
    rays = cast(ImagePointRows, SimpleNamespace(c_mm=np.full(3, 24.0)))
    images, rotation, centre = np.ones(2, dtype=bool), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))
    done: Any = component.adjusted_component(rays, images, rotation, centre, ("a", "b"), ("1",))
    assert done == "the others"
    assert limits == pytest.approx([24.0 * 0.03, 24.0 * 0.005])
