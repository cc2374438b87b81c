"""Rays by least squares on a made-up relief: errors are as large as the standard deviations say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.pixels.least_squares_matching import matched_rays
from aatri.regular_file import content_of
from tests.made_photographs import F_PX, HEIGHT, WIDTH, Array, _about, photograph, relief, texture

Image = pytest.importorskip("PIL.Image")
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
