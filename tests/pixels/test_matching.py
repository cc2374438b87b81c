"""Matches, pairs and tracks, on descriptors and graphs that are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from aatri.orientation.relative.tracks import lone_joints, tracks_of
from aatri.pixels.least_squares_matching import least_squares_match, matched_rays, part_shifts
from aatri.pixels.matching import all_pairs, coarse_pairs, consecutive_pairs, matched, near_pairs
from aatri.regular_file import content_of
from tests.made_photographs import F_PX, HEIGHT, WIDTH, Array, _about, photograph, relief, texture


def _unit(values: np.ndarray) -> np.ndarray:
    return (values / np.linalg.norm(values, axis=1, keepdims=True)).astype(np.float32)


def test_matches_are_mutual_and_clear() -> None:
    rng = np.random.default_rng(3)
    left = _unit(rng.random((40, 128)))
    order = rng.permutation(40)
    right = _unit(left[order] + rng.normal(0, 0.01, (40, 128)))
    rows = matched(left, right)
    assert (order[rows[:, 1]] == rows[:, 0]).all()
    assert len(rows) == 40
    twice = np.concatenate([right, right])  # a repeated pattern: no match is clear
    assert len(matched(left, twice)) == 0
    assert matched(left[:1], right).shape == (0, 2)


def test_pairs_by_positions_sequence_and_largest_features() -> None:
    position = np.array([[0.0, 0], [10, 0], [20, 0], [np.nan, 0], [0, 1]])
    assert near_pairs(position, 1).tolist() == [[0, 4], [0, 1], [1, 2]] or sorted(near_pairs(position, 1).tolist()) == [
        [0, 1],
        [0, 4],
        [1, 2],
    ]
    assert consecutive_pairs(np.array([4, 2, 0]), 2).tolist() == [[0, 2], [0, 4], [2, 4]]
    assert consecutive_pairs(np.array([4]), 2).shape == (0, 2)
    assert len(all_pairs(5)) == 10
    rng = np.random.default_rng(4)
    a, b = _unit(rng.random((50, 128))), _unit(rng.random((50, 128)))
    assert coarse_pairs([a, b, a]).tolist() == [[0, 2]]


def test_tracks_join_matches_and_refuse_two_places_of_one_image() -> None:
    first = np.array([0, 3, 6, 9])  # three images of three features
    tracks = tracks_of(np.array([0, 3, 1]), np.array([3, 6, 4]), first)
    assert tracks.track.tolist() == [0, 0, 0, 1, 1]
    assert tracks.image.tolist() == [0, 1, 2, 0, 1]
    assert tracks.keypoint.tolist() == [0, 0, 0, 1, 1]
    assert tracks.refused == 0
    torn = tracks_of(np.array([0, 3, 6]), np.array([3, 6, 1]), first)  # features 0 and 1 of the first image
    assert torn.refused == 1
    assert not len(torn.track)


def test_joints_of_one_pair_are_those_without_which_the_images_fall_apart() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        n = int(rng.integers(2, 12))
        pairs = np.unique(np.sort(rng.integers(0, n, (int(rng.integers(1, 2 * n)), 2)), axis=1), axis=0)
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        parts = _parts(pairs, n)
        alone = [k for k in range(len(pairs)) if _parts(np.delete(pairs, k, axis=0), n) > parts]
        assert lone_joints(pairs, n).tolist() == alone


def _parts(pairs: np.ndarray, n: int) -> int:
    of = list(range(n))
    for i, j in pairs.tolist():
        of = [of[i] if x == of[j] else x for x in of]
    return len(set(of))


# -- least squares matching --


@pytest.mark.parametrize("negative", [False, True])
def test_a_patch_is_found_to_a_hundredth_of_a_pixel(negative: bool) -> None:
    ground = texture()[:200, :200]
    A, p = np.array([[1.05, 0.08], [-0.06, 0.97]]), np.array([60.3, 57.8])
    rows, columns = np.indices((21, 21)) - 10
    at = np.stack([columns.ravel(), rows.ravel()], axis=1) @ A.T + p  # the patch shows the image through A
    patch = map_coordinates(ground, at.T[::-1], order=5).reshape(21, 21)
    rng = np.random.default_rng(1)
    image = 0.8 * (255 - ground if negative else ground) + 20 + rng.normal(0, 2, ground.shape)
    found = least_squares_match(image, patch, p + np.array([1.2, -0.9]), "affine")
    assert found is not None
    assert np.abs(found.xy_px - p).max() < 0.05
    assert np.abs(found.linear - A).max() < 0.01
    assert (found.correlation < 0) == negative
    assert (np.abs(found.xy_px - p) < 3 * found.sigma_px(part_shifts([found]))).all()


def test_plain_ground_and_the_edge_match_nothing() -> None:
    flat = np.full((60, 60), 100.0)
    assert least_squares_match(flat, np.full((21, 21), 50.0), np.array([30.0, 30.0])) is None
    assert least_squares_match(texture()[:60, :60], texture()[:21, :21], np.array([5.0, 30.0])) is None


# Rays by least squares on a made-up relief: errors are as large as the standard deviations say.


CENTRE = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
EDGE_PX = 30


def _ground(position: Array, R: Array, xy: Array) -> Array:
    """Where a ray meets the relief."""
    u = R @ np.array([xy[0] - CENTRE[0], CENTRE[1] - xy[1], -F_PX])
    X = position
    for _ in range(60):
        X = position + u * ((relief(X[0], X[1]) - position[2]) / u[2])
    return X


def _image(position: Array, R: Array, X: Array) -> Array:
    u = R.T @ (X - position)
    return CENTRE + np.array([-1.0, 1.0]) * F_PX * u[:2] / u[2]


def _by_ground(position: Array, R: Array, X: Array) -> Array:
    steps = 0.01 * np.eye(3)[:2]
    return np.column_stack([(_image(position, R, X + d) - _image(position, R, X - d)) / 0.02 for d in steps])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("base_m", "lower_m", "kappa", "noise"), [(32.0, 0.0, 0.0, 2.0), (60.0, 0.0, 0.5, 2.0), (32.0, 20.0, 3.0, 5.0)]
)
def test_errors_are_as_large_as_the_standard_deviations_say(
    tmp_path: Path, base_m: float, lower_m: float, kappa: float, noise: float
) -> None:
    Image = pytest.importorskip("PIL.Image")
    positions = [np.array([20.0, 20.0, 100.0]), np.array([20.0 + base_m, 22.0, 100.0 - lower_m])]
    turns = [_about(0, 0.03) @ _about(1, -0.02), _about(0, -0.02) @ _about(1, 0.03) @ _about(2, kappa)]
    files = [str(tmp_path / f"{k}.png") for k in range(2)]
    for k, file in enumerate(files):
        Image.fromarray(photograph(texture(), positions[k], turns[k], noise, k)).save(file)
    rng, places, true = np.random.default_rng(1), list[list[float]](), list[Array]()
    inner = np.array([WIDTH, HEIGHT]) - EDGE_PX
    while len(places) < 200:
        left = rng.uniform(EDGE_PX, inner)
        X = _ground(positions[0], turns[0], left)
        right = _image(positions[1], turns[1], X)
        if (right < EDGE_PX).any() or (right > inner).any():
            continue
        linear = _by_ground(positions[1], turns[1], X) @ np.linalg.inv(_by_ground(positions[0], turns[0], X))
        places.append([*left, *(right + rng.normal(0, 0.3, 2)), *linear.ravel()])
        true.append(right)
    marks = matched_rays(files[0], files[1], [content_of(file) for file in files], 10, places).marks
    ray, reference = (marks.take(np.arange(k * 200, k * 200 + 200)) for k in (0, 1))
    good = ray.correlation > 0.8
    assert good.mean() > 0.9
    error = (ray.xy_px - np.array(true))[good]
    assert np.sqrt((error**2).mean()) < 0.06
    normalised = error**2 / (ray.sigma_px**2 + reference.sigma_px**2)[good]
    assert 0.8 < normalised.mean() < 1.25
