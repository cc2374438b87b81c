"""Distortion models: published formulas, round trips, derivatives, folds."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from aatri.camera.models import forward_models, inversion
from aatri.camera.models.brown import PARAMETERS, brown_basis, brown_correction, brown_derivative
from aatri.camera.models.distortion import Distortion, corner_points, corrected, table_correction
from aatri.errors import InputError

BROWN = {"k1": 5e-9, "k2": -2.2e-13, "k3": 3e-18, "p1": 5e-8, "p2": -3e-8, "b1": 1e-5, "b2": -2e-5}
FORWARD = {
    "opencv": {"k1": -0.2, "k2": 0.08, "p1": 1e-3, "p2": -5e-4, "k3": -0.01, "k4": 0.01, "k5": 0.002, "k6": 1e-4},
    "polynomial": {
        "k1": -0.2,
        "k2": 0.08,
        "k3": -0.01,
        "k4": 2e-3,
        "k7": 1e-5,
        "p1": 1e-3,
        "p2": -5e-4,
        "a1": 2e-3,
        "a2": -1e-3,
        "b2": 3e-3,
    },
    "fisheye": {"k1": 0.03, "k2": -0.01, "k3": 0.002, "k4": -1e-4},
    "bal": {"k1": -0.15, "k2": 0.04},
}
POINTS = np.array([[0.0, 0.0], [1e-5, -2e-5], [12.0, -7.0], [-60.0, 100.0], [105.0, 104.0]])


def test_brown_by_hand() -> None:
    # x = 100, y = 0: dx = k1 1e6 + p1 (1e4 + 2e4) + b1 100, dy = p2 1e4
    found = brown_correction(np.array([[100.0, 0.0]]), {"k1": 1e-8, "p1": 1e-7, "p2": 2e-7, "b1": 1e-5})
    assert found[0] == pytest.approx([1e-2 + 3e-3 + 1e-3, 2e-3], rel=1e-12)


def test_dbat3_is_brown_of_square_pixels() -> None:
    """x = (1 + as) 10 = 12, y = 5, r^2 = 169: dx = 12 k1 169, dy = 5 k1 169."""
    found = corrected(Distortion("dbat3", 100.0, {"as": 0.2, "k1": 1e-5}), np.array([[10.0, 5.0]]))
    np.testing.assert_allclose(found, [[12.0 + 12 * 169e-5, 5.0 + 5 * 169e-5]], rtol=1e-14)
    with pytest.raises(InputError, match="dbat3 has no parameter 'b1'"):
        corrected(Distortion("dbat3", 100.0, {"b1": 1e-5}), np.zeros((1, 2)))


def test_brown_takes_the_radius_from_the_symmetry_point_and_x_y_from_the_principal_point() -> None:
    # r = 0 at (0.3, -0.2): dx = 2 p1 x^2 + 2 p2 x y + b1 x + b2 y, dy = 2 p2 y^2 + 2 p1 x y
    x, y = symmetry = (0.3, -0.2)
    found = brown_correction(np.array([symmetry]), BROWN, symmetry)
    p1, p2 = BROWN["p1"], BROWN["p2"]
    wanted = [2 * p1 * x * x + 2 * p2 * x * y + BROWN["b1"] * x + BROWN["b2"] * y, 2 * p2 * y * y + 2 * p1 * x * y]
    assert found[0] == pytest.approx(wanted, abs=1e-18)


def test_brown_derivatives() -> None:
    symmetry = (0.3, -0.2)
    found = brown_derivative(POINTS, BROWN, symmetry)
    for axis in (0, 1):
        step = np.zeros((len(POINTS), 2), complex)
        step[:, axis] = 1e-30j
        wanted = brown_correction(POINTS + step, BROWN, symmetry).imag / 1e-30
        assert found[:, :, axis] == pytest.approx(wanted, rel=1e-11, abs=1e-16)
    basis = brown_basis(POINTS)
    for k, name in enumerate(PARAMETERS):
        one = brown_correction(POINTS, {name: 1.0})
        assert basis[:, :, k] == pytest.approx(one, rel=1e-14)


def test_table_is_linear_between_its_entries_and_zero_at_the_symmetry_point() -> None:
    radius, correction = np.array([10.0, 20.0, 40.0]), np.array([0.002, -0.001, 0.003])
    symmetry = (1.0, 0.0)
    points = np.array([[1.0, 0.0], [6.0, 0.0], [1.0, 15.0], [-29.0, 0.0], [61.0, 0.0]])
    found = table_correction(points, radius, correction, symmetry)
    wanted = [[0, 0], [0.001, 0], [0, 0.0005], [-0.001, 0], [0.003, 0]]
    assert found == pytest.approx(np.array(wanted), abs=1e-15)


@pytest.mark.parametrize("radius", [[], [20.0, 10.0], [5.0, 5.0], [-1.0, 5.0]])
def test_a_table_whose_radii_do_not_ascend_is_refused(radius: list[float]) -> None:
    with pytest.raises(InputError, match="radii"):
        table_correction(POINTS, np.array(radius), np.zeros(len(radius)))


def test_a_table_in_the_wrong_unit_folds_and_is_refused() -> None:
    with pytest.raises(InputError, match="folds"):
        table_correction(POINTS, np.array([0.0, 10.0, 20.0]), np.array([0.0, 4.0, -9.0]))


@pytest.mark.parametrize("model", sorted(FORWARD))
def test_forward_models_round_trip(model: str) -> None:
    c = 120.0
    forward = getattr(forward_models, model)
    y_down = np.array([1.0, -1.0])
    distorted = forward(POINTS * y_down / c, FORWARD[model])[0] * y_down * c
    found = corrected(Distortion(model, c, FORWARD[model]), distorted)
    assert np.abs(found - POINTS).max() < 1e-9
    assert np.abs(distorted - POINTS)[2:].max() > 0.01  # it does something


@pytest.mark.parametrize("model", sorted(FORWARD))
def test_forward_derivatives(model: str) -> None:
    uv = np.concatenate([POINTS / 120.0, [[1e-7, 2e-7]]])
    forward = partial(getattr(forward_models, model), parameters=FORWARD[model])
    found = forward(uv)[1]
    for axis in (0, 1):
        step = np.zeros(uv.shape, complex)
        step[:, axis] = 1e-30j
        wanted = forward(uv + step)[0].imag / 1e-30
        assert found[:, :, axis] == pytest.approx(wanted, rel=1e-10, abs=1e-12)


def test_opencv_tangential_terms_count_v_downwards() -> None:
    # OpenCV: u_d = u + 2 p1 u v + p2 (r^2 + 2 u^2), v_d = v + p1 (r^2 + 2 v^2) + 2 p2 u v; photo y is -v
    u, v, p1 = 0.3, 0.2, 1e-3
    distorted = np.array([[u + 2 * p1 * u * v, -(v + p1 * (u * u + 3 * v * v))]])
    found = corrected(Distortion("opencv", 1.0, {"p1": p1}), distorted)
    assert found[0] == pytest.approx([u, -v], abs=1e-12)


def test_fisheye_without_parameters_is_the_equidistant_projection() -> None:
    theta = np.deg2rad(70.0)
    found = corrected(Distortion("fisheye", 10.0), np.array([[10.0 * theta, 0.0]]))
    assert found[0] == pytest.approx([10.0 * np.tan(theta), 0.0], rel=1e-12)


def test_small_brown_and_bal_agree_to_first_order() -> None:
    # bal r_d = r (1 + k r^2) is corrected by -k r^2 / c^2, but for terms of k^2
    k, c = 1e-6, 100.0
    points = np.array([[50.0, 30.0]])
    forward = corrected(Distortion("bal", c, {"k1": k}), points) - points
    added = corrected(Distortion("brown", c, {"k1": -k / c**2}), points) - points
    assert forward == pytest.approx(added, rel=1e-5)


@pytest.mark.parametrize(
    ("model", "parameters"),
    [("brown", {"k1": -5e-5}), ("bal", {"k1": -0.8}), ("opencv", {"k1": -0.8}), ("fisheye", {"k1": -0.6})],
)
def test_a_fold_inside_the_format_is_refused(model: str, parameters: dict[str, float]) -> None:
    with pytest.raises(InputError, match="folds inside the format"):
        corrected(Distortion(model, 100.0, parameters), corner_points(np.array([115.0, 115.0])))


@pytest.mark.parametrize("chunk", [1, 3, 10_000])
def test_the_first_point_beyond_a_fold_is_named_whatever_the_pieces(
    chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inversion, "CHUNK", chunk)
    points = np.array([[1.0, 1.0], [2.0, 1.0], [90.0, 90.0], [3.0, 1.0], [100.0, 100.0]])
    with pytest.raises(InputError, match=r"on the way to \(90\.000, 90\.000\)"):
        corrected(Distortion("brown", 100.0, {"k1": -5e-5}), points)


def test_unknown_models_and_parameters_are_named() -> None:
    with pytest.raises(InputError, match="did you mean 'brown'"):
        corrected(Distortion("bown", 100.0), POINTS)
    with pytest.raises(InputError, match="no parameter 'p3'"):
        corrected(Distortion("brown", 100.0, {"p3": 1.0}), POINTS)
