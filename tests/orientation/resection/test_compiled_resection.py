"""The compiled resection against its NumPy form, which judges rank by eigenvalues and goes all images in step."""

from __future__ import annotations

import numpy as np
import pytest

import aatri.adjustment.threads as threads
import aatri.orientation.resection.adjustment as adjustment
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.limits import MIN_POINTS
from aatri.geometry.rotations import rotation_from_angles
from aatri.orientation.resection.adjustment import DECREMENT, HUBER, resect_images
from aatri.orientation.resection.kernels.resection import normal_equations
from tests.complex_step import complex_step
from tests.orientation.resection.reference import resect_in_step

C_MM = 120.0


def _block(seed: int, n_images: int = 20, n_points: int = 60) -> dict[str, np.ndarray]:
    """Images of a hilly site with noise and 3 % gross errors, from starts some 10 m and 0.05 rad off."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-300, 300, (n_points, 3)) * [1, 1, 0.15] + [3.4e5, 5.5e6, 200.0]
    angles = rng.normal(0, 0.1, (n_images, 3)) + np.column_stack(
        [np.zeros((n_images, 2)), rng.uniform(-3, 3, n_images)]
    )
    R = rotation_from_angles(angles)
    X0 = rng.normal(0, 60, (n_images, 3)) + np.array([3.4e5, 5.5e6, 900.0])
    order = rng.permutation(n_images * n_points)
    image, point = (x[order].astype(np.int32) for x in divmod(np.arange(n_images * n_points), n_points))
    u = np.einsum("nji,nj->ni", R[image], xyz[point] - X0[image])
    sigma = rng.uniform(0.003, 0.02, (len(image), 2))
    xy = -C_MM * u[:, :2] / u[:, 2:] + rng.normal(0, 1, sigma.shape) * sigma
    wrong = rng.random(len(image)) < 0.03
    xy[wrong] += rng.uniform(-5, 5, (int(wrong.sum()), 2))
    return {
        "xy_mm": xy,
        "sigma_mm": sigma,
        "image": image,
        "point": point,
        "c_mm": np.full(n_images, C_MM),
        "xyz_m": xyz,
        "position_m": X0 + rng.normal(0, 10, X0.shape),
        "ground_from_image": rotation_from_angles(angles + rng.normal(0, 0.05, angles.shape)),
    }


def _in_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the images be resected by the reference."""

    def resect(
        first, last, start, X, xy, weight, c, fewest, huber, tolerance, iterations, X0, R, Q, spread, done
    ) -> None:
        if first > 0:
            return
        image = np.repeat(np.arange(len(c)), np.diff(start))
        working = np.diff(start) >= fewest
        found = resect_in_step(xy, 1.0 / weight, image, X, c, X0, R, working, huber, tolerance, iterations)
        for into, values in zip((X0, R, Q, spread, done), found):
            into[working] = values[working]

    monkeypatch.setattr(adjustment, "resect", resect)


def _assert_same(found: adjustment.ResectedImages, expected: adjustment.ResectedImages, tolerance: float) -> None:
    np.testing.assert_array_equal(found.resected, expected.resected)
    np.testing.assert_array_equal(found.points, expected.points)
    sigma = np.sqrt(np.einsum("nii->ni", expected.covariance))
    done = found.resected
    assert (np.abs(found.position_m - expected.position_m)[done] <= 1e3 * tolerance * sigma[done, :3]).all()
    np.testing.assert_allclose(found.ground_from_image, expected.ground_from_image, atol=tolerance)
    scale = sigma[:, :, None] * sigma[:, None, :]
    np.testing.assert_allclose(found.covariance / scale, expected.covariance / scale, atol=10 * tolerance)
    np.testing.assert_allclose(found.rms_mm, expected.rms_mm, rtol=tolerance, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_images_with_gross_errors_come_out_as_from_the_numpy_form(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    block = _block(seed)
    compiled = resect_images(**block)
    assert compiled.resected.all()
    _in_numpy(monkeypatch)
    _assert_same(compiled, resect_images(**block), 1e-12)


def test_what_is_not_clearly_determined_is_treated_as_by_the_numpy_form(monkeypatch: pytest.MonkeyPatch) -> None:
    block = _block(4)
    image, point, xyz = block["image"], block["point"], block["xyz_m"]
    keep = np.ones(len(image), dtype=bool)
    for one, points in ((0, 2), (1, 3), (2, 4)):  # too few; no redundancy; some
        keep[np.flatnonzero(image == one)[points:]] = False
    line = xyz.mean(axis=0) + np.linspace(-200, 200, 60)[:, None] * [0.6, 0.8, 0.05]
    block["xyz_m"] = xyz = np.concatenate([xyz, line])  # the ground points of one image, on a line
    point[image == 3] += 60
    block["position_m"][4] = np.nan
    block["ground_from_image"][5, 1, 1] = np.nan
    block["position_m"][6, 2] -= 2000.0  # below the ground, all points behind
    block["position_m"][7] += 1e6
    block["ground_from_image"][8] = block["ground_from_image"][8] @ rotation_from_angles([0.0, 0.0, 1.5])
    xyz[5] = np.nan
    block["xy_mm"][17] = np.nan
    block["position_m"][9] = xyz[point[np.flatnonzero(image == 9)[0]]]  # a ray of no length
    for name in ("xy_mm", "sigma_mm", "image", "point"):
        block[name] = block[name][keep]
    with np.errstate(all="ignore"):
        compiled = resect_images(**block)
        _in_numpy(monkeypatch)
        expected = resect_images(**block)
    assert not expected.resected[[0, 3, 4, 5]].any()
    assert expected.resected[10:].all()
    _assert_same(compiled, expected, 1e-11)
    np.testing.assert_array_equal(compiled.position_m[4], block["position_m"][4])  # the start, unchanged


def test_the_result_has_the_same_bits_for_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    block = _block(5, n_images=13)
    monkeypatch.setattr(adjustment, "WORTH_A_THREAD", 1)
    results = []
    for count in (1, 2, 5):
        monkeypatch.setattr(threads, "default_threads", lambda count=count: count)
        results.append(resect_images(**block))
    for result in results[1:]:
        for name in ("position_m", "ground_from_image", "covariance", "rms_mm", "resected"):
            np.testing.assert_array_equal(getattr(result, name), getattr(results[0], name))


def test_an_image_comes_out_the_same_alone_and_in_a_block() -> None:
    block = _block(6)
    together = resect_images(**block)
    mine = block["image"] == 7
    alone = resect_images(
        **{
            **block,
            **{name: block[name][mine] for name in ("xy_mm", "sigma_mm", "point")},
            "image": np.zeros(mine.sum(), dtype=np.int32),
            "c_mm": block["c_mm"][:1],
            "position_m": block["position_m"][7:8],
            "ground_from_image": block["ground_from_image"][7:8],
        }
    )
    np.testing.assert_allclose(alone.position_m[0], together.position_m[7], atol=1e-8)


def test_compiled_normal_equations_are_those_of_complex_step_derivatives() -> None:
    block = _block(7, n_images=1)
    origin = block["xyz_m"].mean(axis=0)
    X = block["xyz_m"][block["point"]] - origin
    X0, R = block["position_m"][0] - origin, block["ground_from_image"][0]
    weight = 1.0 / block["sigma_mm"]
    robust = np.random.default_rng(1).uniform(0.1, 1.0, len(X))

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        x, d = unknowns[:3], unknowns[3:]
        turned = R + np.cross(d[None], R.T).T  # exp([d]x) R to first order, at d = 0
        u = in_image_axes(np.tile(x, (len(X), 1)), np.tile(turned, (len(X), 1, 1)), X)
        return (project(u, np.full(len(X), C_MM)) - block["xy_mm"]) * weight

    unknowns = np.concatenate([X0, np.zeros(3)])
    J, v = complex_step(residuals, unknowns), residuals(unknowns).ravel()
    p = np.repeat(robust, 2)
    N, g, size = np.empty((6, 6)), np.empty(6), np.empty(len(X))
    total = normal_equations(0, len(X), robust, X, block["xy_mm"], weight, C_MM, X0, R, N, g, size)
    scale = np.sqrt(np.diag(J.T @ (p[:, None] * J)))
    expected = np.tril(J.T @ (p[:, None] * J))
    np.testing.assert_allclose(N / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-12)
    np.testing.assert_allclose(g / scale, J.T @ (p * v) / scale, atol=1e-12 * np.abs(v).max() * len(v))
    assert total == pytest.approx(v @ v, rel=1e-12)
    np.testing.assert_allclose(size, np.sqrt((v.reshape(-1, 2) ** 2).mean(axis=1)), rtol=1e-12)


def test_the_numpy_form_leaves_what_it_is_not_asked_for_alone() -> None:
    block = _block(8, n_images=2)
    order = np.argsort(block["image"], kind="stable")
    part = [block[name][order] for name in ("xy_mm", "sigma_mm", "image")]
    X = block["xyz_m"][block["point"][order]]
    origin = X.mean(axis=0)
    start = block["position_m"] - origin
    X0, R, _, _, done = resect_in_step(
        *part,
        X - origin,
        block["c_mm"],
        start,
        block["ground_from_image"],
        np.array([False, True]),
        HUBER,
        DECREMENT,
        50,
    )
    assert done.tolist() == [False, True]
    np.testing.assert_array_equal(X0[0], start[0])
    np.testing.assert_array_equal(R[0], block["ground_from_image"][0])
    assert MIN_POINTS == 3
