"""Forward models and DBAT's corrections: published formulas, exact derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.camera.models.distortion import Distortion, corrected
from aatri.camera.models.projection import MODELS, PARAMETERS
from aatri.geometry.collinearity import project_derivatives
from tests.camera.models.dbat_reference import dbat1, dbat3, printed_principal_point

VALUES = {
    "pinhole": [120.0, 0.3, -0.2],
    "bal": [400.0, -0.15, 0.04],
    "opencv": [120.0, 1.02, 0.3, -0.2, -0.2, 0.08, 1e-3, -5e-4, -0.01, 0.01, 0.002, 1e-4],
    "polynomial": [120.0, 1.02, 0.3, -0.2, -0.2, 0.08, -0.01, 2e-3, -4e-4, 1e-4, -1e-5, 1e-3, -5e-4, 2e-3, -1e-3, 3e-3],
    "fisheye": [12.0, 0.98, 0.3, -0.2, 0.03, -0.01, 0.002, -1e-4],
}


def _points(model: str) -> np.ndarray[Any, Any]:
    rng = np.random.default_rng(3)
    plane = rng.uniform(-0.8, 0.8, (1000, 2))
    u = np.column_stack([plane, -np.ones(1000)]) * rng.uniform(50, 2000, 1000)[:, None]
    u[0, :2] = 0.0
    u[1, :2] = [1e-9, -2e-9]
    return u


def _by_complex_step(f: Any, x: Any, k: int) -> Any:
    step = np.zeros(x.shape, complex)
    step[..., k] = 1e-200j
    return f(x + step).imag / 1e-200


@pytest.mark.parametrize("model", sorted(MODELS))
@pytest.mark.parametrize("per_ray", [False, True])
def test_derivatives_are_exact(model: str, per_ray: bool) -> None:
    u, values = _points(model), np.array(VALUES[model])
    if per_ray:
        values = values * np.random.default_rng(4).uniform(0.9, 1.1, (len(u), len(values)))
    _, by_u, by_parameters = MODELS[model](u, values)
    for k in range(3):
        wanted = _by_complex_step(lambda z: MODELS[model](z, values)[0], u, k)
        assert np.abs(by_u[:, :, k] - wanted).max() <= 1e-12 * np.abs(wanted).max(), (model, k)
    for k in range(len(PARAMETERS[model])):
        wanted = _by_complex_step(lambda z: MODELS[model](u, z)[0], values, k)
        assert np.abs(by_parameters[:, :, k] - wanted).max() <= 1e-12 * np.abs(wanted).max(), (model, k)


def test_fisheye_derivatives_beside_and_behind_the_camera() -> None:
    values, rng = np.array(VALUES["fisheye"]), np.random.default_rng(5)
    u = rng.normal(size=(500, 3))
    xy, by_u, _ = MODELS["fisheye"](u, values)
    assert np.isfinite(xy).all()
    for k in range(3):
        wanted = _by_complex_step(lambda z: MODELS["fisheye"](z, values)[0], u, k)
        scale = np.abs(by_u).max(axis=(1, 2))
        assert (np.abs(by_u[:, :, k] - wanted).max(axis=1) <= 1e-11 * scale).all()


def test_pinhole_is_the_collinearity_equation() -> None:
    u = _points("pinhole")
    xy, by_u, _ = MODELS["pinhole"](u, np.array([120.0, 0.0, 0.0]))
    wanted, wanted_by_u = project_derivatives(u, 120.0)
    assert np.abs(by_u - wanted_by_u).max() < 1e-15
    assert np.abs(xy - wanted).max() < 1e-13


def test_bal_by_hand() -> None:
    # Agarwal et al.: P = (1, 2, -4): p = -P/P.z = (0.25, 0.5), r^2 = 0.3125, p' = f (1 + k1 r^2 + k2 r^4) p
    xy, _, _ = MODELS["bal"](np.array([[1.0, 2.0, -4.0]]), np.array([100.0, 0.1, 0.01]))
    factor = 1 + 0.1 * 0.3125 + 0.01 * 0.3125**2
    assert xy[0] == pytest.approx([25.0 * factor, 50.0 * factor], rel=1e-15)


@pytest.mark.parametrize("model", ["bal", "opencv", "polynomial", "fisheye"])
def test_forward_models_agree_with_the_correction_of_measured_coordinates(model: str) -> None:
    # image_refinement inverts the same distortion by iteration
    u, values = _points(model)[:50], np.array(VALUES[model])
    names = PARAMETERS[model]
    for name in ("q", "x0", "y0"):
        if name in names:
            values[names.index(name)] = 1.0 if name == "q" else 0.0
    c = values[0]
    lens = {name: value for name, value in zip(names, values) if name not in ("c", "f", "q", "x0", "y0")}
    found = corrected(Distortion(model, c, lens), MODELS[model](u, values)[0])
    assert np.abs(found - project_derivatives(u, c)[0]).max() < 1e-9 * c


CAMCAL = np.array([3.89598e-4, 3.61687, 2.61329, 4.58861e-3, -4.51351e-5, -2.05253e-6, -6.12803e-5, -4.41172e-5])


@pytest.mark.parametrize(("model", "values", "pixel"), [(dbat1, CAMCAL[1:], (0.0032, 0.0031)), (dbat3, CAMCAL, 0.0031)])
def test_dbat_derivatives(model: Any, values: np.ndarray[Any, Any], pixel: Any) -> None:
    rng = np.random.default_rng(6)
    uv = rng.uniform(0, 2000, (200, 2))
    _, by_parameters = model(uv, values, pixel)
    for k in range(len(values)):
        wanted = _by_complex_step(lambda z: model(uv, z, pixel)[0], values, k)
        assert np.abs(by_parameters[:, :, k] - wanted).max() <= 1e-13 * np.abs(wanted).max()


def test_dbat_models_differ_by_the_affinity_only() -> None:
    uv = np.random.default_rng(7).uniform(0, 2000, (50, 2))
    one = dbat1(uv, CAMCAL[1:], ((1 + CAMCAL[0]) * 0.0031, 0.0031))[0]
    assert np.abs(one - dbat3(uv, CAMCAL, 0.0031)[0]).max() < 1e-14


def test_dbat_by_hand() -> None:
    # s = 0.01 mm, (u, v) = (300, 100): x = 1.1 * 3 - 1.3 = 2, y = 2 - 1 = 1, r^2 = 5, K1 = 0.001, P1 = 0.002
    values = np.array([0.1, 1.3, 2.0, 0.001, 0.0, 0.0, 0.002, 0.0])
    found = dbat3(np.array([[300.0, 100.0]]), values, 0.01)[0]
    assert found[0] == pytest.approx([2 + 0.01 + 0.002 * 13, 1 + 0.005 + 0.002 * 4], rel=1e-14)


def test_dbat_prints_the_principal_point_before_the_affinity() -> None:
    value, derivative = printed_principal_point(0.25, 5.0)
    assert value == 4.0
    assert derivative == pytest.approx([-5.0 / 1.25**2, 0.8])
