"""Each program's distortion against its own formula in plain Python; conversions against projections of one ray."""

import contextlib
import math

import numpy as np
import pytest

from aatri.camera.models.distortion import Distortion, corrected
from aatri.errors import InputError
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.conventions.lens_conversion import as_our_camera, as_program_states, camera_columns

W, H, F = 4000.0, 3000.0, 3500.0
U, V = 0.31, -0.22
R2 = U * U + V * V


def metashape(k1: float, k2: float, k3: float, k4: float, p1: float, p2: float, b1: float, b2: float) -> list[float]:
    """Metashape user manual, appendix C: u = W/2 + cx + f x' + b1 x' + b2 y'."""
    g = 1 + k1 * R2 + k2 * R2**2 + k3 * R2**3 + k4 * R2**4
    x = U * g + p1 * (R2 + 2 * U * U) + 2 * p2 * U * V
    y = V * g + p2 * (R2 + 2 * V * V) + 2 * p1 * U * V
    return [F * x + b1 * x + b2 * y, F * y]


def opencv(k1: float, k2: float, k3: float, p1: float, p2: float) -> list[float]:
    """OpenCV, calib3d; Pix4D's R1 R2 R3 T1 T2 are the same."""
    g = 1 + k1 * R2 + k2 * R2**2 + k3 * R2**3
    return [F * (U * g + 2 * p1 * U * V + p2 * (R2 + 2 * U * U)), F * (V * g + p1 * (R2 + 2 * V * V) + 2 * p2 * U * V)]


def micmac(r1: float, r2: float, p1: float, p2: float, b1: float, b2: float) -> list[float]:
    """d in px from the centre of distortion; u' = u + d (R1 r^2 + R2 r^4) + P1 (r^2 + 2 dx^2) + ... + b1 dx + b2 dy."""
    dx, dy = F * U, F * V
    q = dx * dx + dy * dy
    x = dx * (1 + r1 * q + r2 * q * q) + p1 * (q + 2 * dx * dx) + 2 * p2 * dx * dy + b1 * dx + b2 * dy
    return [x, dy * (1 + r1 * q + r2 * q * q) + p2 * (q + 2 * dy * dy) + 2 * p1 * dx * dy]


def kannala(k1: float, k2: float) -> list[float]:
    """Kannala and Brandt: r_d = theta (1 + k1 theta^2 + k2 theta^4)."""
    r = math.sqrt(R2)
    theta = math.atan(r)
    d = theta * (1 + k1 * theta**2 + k2 * theta**4)
    return [F * U * d / r, F * V * d / r]


OF_PROGRAMS = {
    "metashape": ((-0.1, 0.05, -0.01, 0.004, 8e-4, -5e-4, 1.5, -0.7), "k1 k2 k3 k4 p1 p2 b1 b2", metashape),
    "pix4d": ((-0.1, 0.05, -0.01, 8e-4, -5e-4), "R1 R2 R3 T1 T2", opencv),
    "opf": ((-0.1, 0.05, -0.01, 8e-4, -5e-4), "R1 R2 R3 T1 T2", opencv),
    "opensfm-brown": ((-0.1, 0.05, -0.01, 8e-4, -5e-4), "k1 k2 k3 p1 p2", opencv),
    "micmac": ((-8e-9, 3e-16, 3e-7, -2e-7, 4e-4, 2e-4), "R1 R2 P1 P2 b1 b2", micmac),
    "opensfm-fisheye": ((-0.1, 0.05), "k1 k2", kannala),
}


@pytest.mark.parametrize("form", OF_PROGRAMS)
def test_a_ray_falls_where_the_formula_of_the_program_says(form: str) -> None:
    values, names, formula = OF_PROGRAMS[form]
    lens = Lens("c", form, (W, H), (F, F), (0.0, 0.0), dict(zip(names.split(), values)))
    seen = lens.projected(np.array([[U, V]]))
    np.testing.assert_allclose(seen[0], formula(*values), rtol=0, atol=1e-9)
    np.testing.assert_allclose(lens.ideal(seen), [[U, V]], rtol=0, atol=1e-13)


def test_bundler_and_micmac_own_centre() -> None:
    bundler = Lens("c", "bundler", (W, H), (F, F), parameters={"k1": -0.1, "k2": 0.02})
    g = 1 - 0.1 * R2 + 0.02 * R2**2
    np.testing.assert_allclose(bundler.projected(np.array([[U, V]])), [[F * U * g, F * V * g]], rtol=1e-14)
    apart = Lens("c", "micmac", (W, H), (F, F), (10.0, -5.0), {"R1": -8e-9}, centre_px=(3.0, 4.0))
    dx, dy = F * U - 3.0, F * V - 4.0
    q = dx * dx + dy * dy
    np.testing.assert_allclose(
        apart.projected(np.array([[U, V]])), [[F * U + 10 - 8e-9 * q * dx, F * V - 5 - 8e-9 * q * dy]], rtol=1e-13
    )


def test_nvm_corrects_the_measurement() -> None:
    """VisualSFM: (1 + r |m|^2) m = f (X/Z, Y/Z), with m in units of f."""
    lens = Lens("c", "nvm", (W, H), (F, F), parameters={"r": 0.17})
    x, y = (lens.projected(np.array([[U, V]])) / F)[0].tolist()
    assert math.isclose((1 + 0.17 * (x * x + y * y)) * x, U, rel_tol=1e-13)
    assert math.isclose((1 + 0.17 * (x * x + y * y)) * y, V, rel_tol=1e-13)


def test_brown_is_the_correction_of_the_camera_model() -> None:
    parameters = {"k1": 2e-5, "k2": -3e-8, "k3": 1e-11, "p1": 4e-6, "p2": -3e-6, "b1": 2e-4, "b2": 1e-4}
    lens = Lens("c", "brown", (W, H), (F, F), (4.0, -3.0), parameters, pixel_mm=0.004)
    xy_px = np.array([[500.0, -300.0], [-1500.0, 900.0]])
    xy_mm = (xy_px - [4.0, -3.0]) * [0.004, -0.004]
    ideal_mm = corrected(Distortion("brown", F * 0.004, parameters), xy_mm)
    np.testing.assert_allclose(lens.ideal(xy_px), ideal_mm * [1, -1] / (F * 0.004), rtol=0, atol=1e-14)


@pytest.mark.parametrize("form", [f for f in FORMS if f != "none"])
def test_every_form_becomes_one_of_ours_that_projects_the_same(form: str) -> None:
    terms = FORMS[form].terms
    sizes = {"k1": -0.05, "k2": 0.01, "k3": -0.002, "p1": 4e-4, "p2": -3e-4, "b1": 3e-4}
    plain = Lens("c", form, (W, H), (F, F))
    f = plain.unit_per_focal()
    parameters = {n: t.sign * sizes.get(t.name, 0.0) / f**t.power for n, t in terms.items()}
    point = (12.0, -7.0) if FORMS[form].principal_point else (0.0, 0.0)
    lens = Lens("c", form, (W, H), (F, F), point, parameters)
    ours = as_our_camera(lens, allowed_px=1e-3)
    rays = lens.ideal(np.array([[-2000.0, -1500.0], [1234.0, 321.0], [0.0, 0.0], [2000.0, 1500.0]]))
    np.testing.assert_allclose(ours.projected(rays), lens.projected(rays), rtol=0, atol=1e-3)
    with contextlib.suppress(InputError):  # where only a fit goes back
        back = as_program_states(ours, [form], allowed_px=0.0)
        np.testing.assert_allclose(back.projected(rays), lens.projected(rays), rtol=0, atol=1e-9)


def test_the_affinity_of_metashape_is_two_focal_lengths() -> None:
    lens = Lens("c", "metashape", (W, H), (F, F), parameters={"k1": -0.05, "b1": 3.0})
    ours = as_our_camera(lens, allowed_px=0.0)
    assert ours.form == "opencv"
    assert ours.focal_px == pytest.approx((F + 3.0, F), rel=1e-15)
    back = as_program_states(ours, ["metashape"], allowed_px=0.0)
    assert back.parameters["b1"] == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize(
    ("form", "parameters"),
    [
        (
            "metashape",
            {"k1": -0.25, "k2": 0.1, "k3": -0.02, "k4": 0.003, "p1": 4e-4, "p2": -3e-4, "b1": 3.0, "b2": 1.5},
        ),
        ("micmac", {"R1": -2e-8, "R4": 1e-29, "R7": -1e-51, "P1": -2e-8, "P2": 4e-8, "b1": 7e-4, "b2": 8e-5}),
        ("mmvii", {"K1": -0.2, "K5": 1e-3, "p1": 1e-3, "b1": 6e-4, "b2": 1e-4}),
        ("blocksexchange-affine", {"K1": -0.2, "K2": 0.05, "P2": 1e-3, "shear": 2e-4}),
    ],
)
def test_a_skew_or_affinity_beside_a_strong_radial_distortion_is_exact(form: str, parameters: dict[str, float]) -> None:
    lens = Lens("c", form, (W, H), (F, F), (12.0, -7.0), parameters)
    ours = as_our_camera(lens, allowed_px=0.0)
    assert ours.form == "polynomial"
    rays = lens.ideal(np.array([[-2000.0, -1500.0], [2000.0, -1500.0], [0.0, 700.0]]))
    np.testing.assert_allclose(ours.projected(rays), lens.projected(rays), rtol=0, atol=1e-9)
    back = as_program_states(ours, [form], allowed_px=0.0)
    assert {n: v for n, v in back.parameters.items() if v} == pytest.approx(parameters, rel=1e-9)


@pytest.mark.slow
def test_a_distortion_about_another_centre_is_fitted_or_refused() -> None:
    wild = Lens("c", "micmac", (W, H), (F, F), parameters={"R1": 1e-8}, centre_px=(900.0, -700.0))
    with pytest.raises(InputError, match=r"camera c.*differs by up to .* px, more than 0.05 px"):
        as_our_camera(wild)


def test_columns_of_a_camera_and_what_is_free() -> None:
    lens = Lens("c", "opencv", (W, H), (F, F + 7), (2.0, 3.0), {"k1": 0.01})
    cameras, parameters = camera_columns([lens], calibrate=True)
    np.testing.assert_allclose(cameras["pixel_size_mm"], [[0.001, 0.001 * F / (F + 7)]])
    np.testing.assert_allclose(cameras["principal_point_mm"], [[0.002, -0.003 * F / (F + 7)]])
    assert cameras["principal_distance_mm"] == pytest.approx(3.5)
    assert dict(zip(parameters["name"], parameters["free"])) == dict.fromkeys(parameters["name"], True)
    _, fixed = camera_columns([Lens("n", "bundler", (W, H), (F, F))], calibrate=True)
    free = dict(zip(fixed["name"], fixed["free"]))
    assert free["k1"]
    assert free["principal_distance"]
    assert not free["principal_point.x"]
