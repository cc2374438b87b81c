"""Camera parameters: shared by camera, flight or image at choice, with all covariances; camera models handed over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block, CameraParameters
from aatri.artifacts.solution import Solution
from aatri.errors import InputError, SpecError
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.dense_bundle import Dense, by_complex_step, correlations, cross, inner_constraints
from tests.stages.close_range_blocks import field_block, measured, with_bar, with_open_camera
from tests.stages.film_blocks import Told

VARIANT = {"image": ["c", "x0", "y0"], "camera": ["k1", "k2", "p1", "p2"]}
SIGMA_MM = 0.05
RADIUS_MM = float(np.hypot(18.0, 12.0))
FREE = {"datum": "free", "tolerance": 1e-8, "blunders": {"method": "none"}}


def _undistorted(block: Block) -> Block:
    """The block with a camera that says nothing of its lens."""
    return replace(
        block, cameras=replace(block.cameras, distortion=np.array(["none"])), camera_parameters=CameraParameters.empty()
    )


@pytest.fixture(scope="module")
def block() -> Block:
    return with_bar(field_block(3, 2, 5, 30))


@pytest.fixture(scope="module")
def calibration(block: Block) -> Solution:
    opened = with_open_camera(block)
    return bundle(opened, measured(opened), options=BundleOptions(**FREE))


def _covariances(solution: Solution) -> np.ndarray:
    """Of all parameters that the artifact tells, in their order."""
    c, n = solution.parameter_covariances, len(solution.parameters)
    assert c is not None
    C = np.full((n, n), np.nan)
    C[c.first, c.second] = C[c.second, c.first] = c.covariance
    return C


def _corrected(z: np.ndarray, R: np.ndarray, xy: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Residuals with k1 k2 p1 p2 of the camera and c x0 y0 of the image, after X0 d X; the terms stand at `at`."""
    u = np.einsum("nji,nj->ni", R + cross(z[:, 3:6]) @ R, z[:, 6:9] - z[:, :3])
    k1, k2, p1, p2, dc, dx0, dy0 = z[:, 9:].T
    x, y = at.T
    s = x * x + y * y
    dx = -x * dc / 24.0 - dx0 + x * (k1 * s + k2 * s * s) + p1 * (s + 2 * x * x) + 2 * p2 * x * y
    dy = -y * dc / 24.0 - dy0 + y * (k1 * s + k2 * s * s) + p2 * (s + 2 * y * y) + 2 * p1 * x * y
    return np.stack([-24.0 * u[:, 0] / u[:, 2] - dx, -24.0 * u[:, 1] / u[:, 2] - dy], axis=1) - xy


@pytest.mark.slow
def test_image_variant_and_block_invariant_parameters_have_the_covariances_of_a_dense_computation(block: Block) -> None:
    plain = _undistorted(block)
    points = measured(plain)
    sets = {"set": "brown_conrady", "per": VARIANT, "sigma_um": 1e3 * SIGMA_MM}
    solution = bundle(plain, points, options=BundleOptions(self_calibration=sets, **FREE))
    m, n, k = points.measurements, len(solution.images), len(solution.points)
    p = solution.parameters
    assert p.name[:4].tolist() == ["k1", "k2", "p1", "p2"]
    assert p.object[4:].tolist() == np.repeat(solution.images.id, 3).tolist()
    values = np.concatenate([np.tile(p.value[:4], (len(m), 1)), p.value[4:].reshape(n, 3)[m.image]], axis=1)
    z = np.concatenate(
        [solution.images.position_m[m.image], np.zeros((len(m), 3)), solution.points.xyz_m[m.point], values], axis=1
    )
    R, size, first = solution.images.ground_from_image[m.image], 6 * n + 3 * k + 4 + 3 * n, 6 * n + 3 * k
    columns = np.concatenate(
        [
            6 * m.image[:, None] + np.arange(6),
            6 * n + 3 * m.point[:, None] + np.arange(3),
            np.tile(first + np.arange(4), (len(m), 1)),
            first + 4 + 3 * m.image[:, None] + np.arange(3),
        ],
        axis=1,
    )
    dense = Dense.of(size)
    at = m.xy_mm
    for _ in range(10):  # the adjusted coordinates: measured ones and their residuals
        at = m.xy_mm + _corrected(z, R, m.xy_mm, at)
    dense.add(by_complex_step(lambda z: _corrected(z, R, m.xy_mm, at), z), columns, m.sigma_mm)
    sigma = SIGMA_MM * np.concatenate([RADIUS_MM ** np.array([-3.0, -5.0, -2.0, -2.0]), np.ones(3 * n)])
    own = np.arange(first, size)
    dense.N[own, own] += 1.0 / sigma**2
    ends = [int(np.flatnonzero(block.points.id == name)[0]) for name in block.relative_control_members.id]
    away = solution.points.xyz_m[ends[0]] - solution.points.xyz_m[ends[1]]
    unit = away / np.linalg.norm(away)
    at = 6 * n + np.concatenate([3 * ends[0] + np.arange(3), 3 * ends[1] + np.arange(3)])
    dense.add(np.concatenate([unit, -unit])[None, None], at[None], block.relative_control.sigma[:, None])
    Q = dense.covariance(inner_constraints(size, 6 * n, solution.points.xyz_m))[first:, first:]
    C = _covariances(solution)
    np.testing.assert_allclose(np.sqrt(np.diag(C)), np.sqrt(np.diag(Q)), rtol=1e-8)
    np.testing.assert_allclose(correlations(C), correlations(Q), atol=1e-8)
    np.testing.assert_allclose(p.sigma, np.sqrt(np.diag(Q)), rtol=1e-8)


def test_parameters_of_a_flight_are_found_apart(block: Block) -> None:
    """Two flights, the second with another principal point: x0 per flight finds the difference."""
    plain = _undistorted(block)
    flight = np.where(np.arange(len(plain.images)) % 2 == 0, "first", "second")
    plain = replace(plain, images=replace(plain.images, flight=flight))
    points = measured(plain)
    xy = points.measurements.xy_mm.copy()
    xy[flight[points.measurements.image] == "second", 0] += 0.2
    points = replace(points, measurements=replace(points.measurements, xy_mm=xy))
    per = {"camera": ["c", "k1", "k2", "k3", "p1", "p2", "b1", "b2"], "flight": ["x0", "y0"]}
    sets = {"set": "brown_conrady", "per": per, "sigma_um": None}
    p = bundle(plain, points, options=BundleOptions(self_calibration=sets, **FREE)).parameters
    x0 = p.name == "x0"
    assert p.object[x0].tolist() == ["camera/first", "camera/second"]
    difference = p.value[x0][1] - p.value[x0][0]
    assert abs(difference - 0.2) < 4 * np.hypot(*p.sigma[x0])


def test_a_calibrated_camera_model_weights_that_of_another_block_with_its_covariance(calibration: Solution) -> None:
    """A block that adds next to nothing keeps values and covariances."""
    other = with_bar(field_block(4, 2, 4, 20))
    vague = replace(measured(other).measurements, sigma_mm=np.full((len(other.image_points), 2), 0.3))
    points = replace(measured(other), measurements=vague)
    found = bundle(other, points, None, calibration, options=BundleOptions(**FREE))
    mine, theirs = found.parameters, calibration.parameters
    assert mine.name.tolist() == theirs.name.tolist()
    assert (np.abs(mine.value - theirs.value) <= 1e-2 * theirs.sigma).all()
    free = theirs.sigma > 0
    assert free.sum() == 10
    np.testing.assert_allclose(_covariances(found)[free][:, free], _covariances(calibration)[free][:, free], rtol=1e-3)


def test_a_calibration_is_one_more_observation_of_the_parameters() -> None:
    """Its information adds to that of the block: P^-1 = P_block^-1 + P_calibration^-1, whatever the nominal point."""
    field, other = (with_bar(field_block(seed, 2, 5, 30, noise=0.0)) for seed in (3, 4))  # linearised at the truth
    opened, first = with_open_camera(other), with_open_camera(field)
    calibration = bundle(first, measured(first), options=BundleOptions(**FREE))
    alone = bundle(opened, measured(opened), options=BundleOptions(**FREE))
    told = Told()
    both = bundle(other, measured(other), None, calibration, options=BundleOptions(**FREE), context=told)
    free = alone.parameters.sigma > 0
    P, A, B = (np.linalg.inv(_covariances(s)[free][:, free]) for s in (both, alone, calibration))
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    np.testing.assert_allclose(P / scale, (A + B) / scale, atol=1e-6)
    assert any("difference to the calibration, chi-square" in line for line in told.lines)
    moved = replace(other, cameras=replace(other.cameras, principal_point_mm=np.array([[0.25, 0.1]])))
    again = bundle(moved, measured(moved), None, calibration, options=BundleOptions(**FREE))
    np.testing.assert_allclose(again.cameras.principal_point_mm, both.cameras.principal_point_mm, atol=1e-7)


def test_another_lens_than_the_calibrated_one_is_told(calibration: Solution) -> None:
    other = with_bar(field_block(4, 2, 5, 30))
    points = measured(other)
    refocused = replace(points, measurements=replace(points.measurements, xy_mm=1.004 * points.measurements.xy_mm))
    told = Told()
    bundle(other, refocused, None, calibration, options=BundleOptions(**FREE), context=told)
    assert any("has the camera changed since" in text for text in told.warnings)


def test_what_cannot_be_handed_over_is_refused(block: Block, calibration: Solution) -> None:
    points = measured(block)
    options = BundleOptions(**FREE)
    opencv = replace(
        block,
        cameras=replace(block.cameras, distortion=np.array(["opencv"])),
        camera_parameters=CameraParameters.empty(),
    )
    with pytest.raises(InputError, match="camera has the parameters principal_distance, q,"):
        bundle(opencv, points, None, calibration, options=options)
    spare = replace(block, cameras=replace(block.cameras, id=np.array(["spare"])))
    with pytest.raises(InputError, match="the calibration does not have spare"):
        bundle(spare, points, None, calibration, options=options)
    nothing = np.where(calibration.parameters.sigma > 0, np.nan, 0.0)
    bare = replace(calibration, parameters=replace(calibration.parameters, sigma=nothing))
    with pytest.raises(InputError, match="no standard deviations"):
        bundle(block, points, None, bare, options=options)
    aside = replace(block, cameras=replace(block.cameras, symmetry_point_mm=np.array([[0.1, 0.0]])))
    with pytest.raises(InputError, match=r"symmetry_point 0\.1, 0 mm"):
        bundle(aside, points, options=options)


@pytest.mark.parametrize(
    ("per", "what"),
    [
        ({"camera": ["k1", "x0"], "image": ["x0"]}, "names x0 twice"),
        ({"camera": []}, "names no parameter"),
        ({"camera": ["k9"]}, "no parameter 'k9'"),
    ],
)
def test_parts_that_make_no_set_are_refused(block: Block, per: dict[str, list[str]], what: str) -> None:
    plain = _undistorted(block)
    with pytest.raises(SpecError, match=what):
        bundle(plain, measured(plain), options=BundleOptions(self_calibration={"set": "brown_conrady", "per": per}))


@pytest.mark.slow
def test_flights_that_the_block_does_not_name_are_told(block: Block) -> None:
    plain, told = _undistorted(block), Told()
    sets = {"set": "brown_conrady", "per": {"camera": ["k1", "k2"], "flight": ["c"]}}
    options = BundleOptions(self_calibration=sets, **FREE | {"tolerance": 1e-3, "max_sigma0": 1e3})
    bundle(plain, measured(plain), options=options, context=told)
    assert any("which stay zero: x0, y0, k3, p1, p2, b1, b2" in line for line in told.lines)
    assert any("no image has a flight (images.csv): all images of a camera share c" in text for text in told.warnings)


def test_units_that_share_nothing_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="camara shares no parameters - did you mean 'camera'"):
        BundleOptions(self_calibration={"set": "brown_conrady", "per": {"camara": ["k1"]}})
    with pytest.raises(ValueError, match="names stand in a list"):
        BundleOptions(self_calibration={"set": "brown_conrady", "per": {"camera": "k1"}})
