"""Positions with lever arm, shift, drift and exposure-time offset unknown: derivatives, groups, refusals, recovery."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.codes import ANTENNA
from aatri.errors import InputError
from aatri.geometry.rotations import rotation_from_angles, skew
from aatri.observations.carried_vectors import ARMS, EXPOSURE_TIME, LEVER_ARM, offset_unknowns
from aatri.observations.drift import DRIFT, SharedUnknowns, drift_term
from aatri.observations.poses import POSE, Poses
from aatri.observations.positions import PositionOptions, Positions, drift_groups, observed_positions, positions_of
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns.variance_components import error_free
from tests.complex_step import complex_step

ARM, OFFSET_S = np.array([0.3, -0.2, 1.1]), 0.02


@pytest.fixture(scope="module")
def block() -> Block:
    """Flown as planned: the velocity is the same throughout a strip."""
    return error_free(position_sigma_m=(0.0, 0.0, 0.0))


def _free_arm(block: Block, sigma: float = np.inf, axes: str = "yz") -> Block:
    """The arm of camera A unknown: free, or weighted. Along the flight it would not be told from a time offset."""
    n, p, arm = len(axes), block.camera_parameters, block.cameras.lever_arm_m.copy()
    arm[0, 0] = ARM[0]
    block = replace(block, cameras=replace(block.cameras, lever_arm_m=arm))
    rows = {
        "camera": np.zeros(n, np.int32),
        "name": np.array([f"lever_arm.{a}" for a in axes]),
        "value": np.full(n, np.nan),
        "sigma": np.full(n, sigma if np.isfinite(sigma) else np.nan),
        "free": np.full(n, not np.isfinite(sigma)),
    }
    return replace(block, camera_parameters=type(p)(**rows))


def test_derivatives_are_those_of_the_complex_step(block: Block) -> None:
    rng, n = np.random.default_rng(2), 3
    at = np.arange(n, dtype=np.int32)
    rows = Positions(at, at, rng.normal(0, 50, (n, 3)), np.tile(0.01 * np.eye(3), (n, 1, 1)), np.zeros((n, 3)))
    R = np.stack([rotation_from_angles(rng.uniform(-3, 3, 3)) for _ in range(n)])
    X0, time, u = rng.normal(0, 50, (n, 3)), np.array([-2.0, 0.5, 1.5]), rng.normal(0, 60, (n, 3))
    of_camera = np.zeros(n, np.int64)
    terms = [
        drift_term(np.full(n, "g"), time),
        SharedUnknowns(ARMS.unknowns(block), block.cameras.lever_arm_m, of_camera),
        SharedUnknowns(offset_unknowns(block), np.zeros((2, 1)), of_camera, u[:, :, None]),
    ]
    (o,) = observed_positions(rows, np.zeros(3), np.array(list("abc")), None, terms)
    d, a, dt = rng.normal(0, 1, (1, 6)), rng.normal(0, 1, (2, 3)), rng.normal(0, 1, (2, 1))
    state = {POSE: Poses(X0, R), DRIFT: d, LEVER_ARM: a, EXPOSURE_TIME: dt}
    v, jacobians = o.records.evaluate(state, np.arange(n))
    for k in range(n):

        def f(z: np.ndarray, k: int = k) -> np.ndarray:
            turned = (np.eye(3) + skew(z[3:6])) @ R[k] @ z[6:9]
            return z[:3] + turned + z[9:12] + time[k] * z[12:15] + u[k] * z[15] - rows.position_m[k]

        z = np.concatenate([X0[k], np.zeros(3), a[0], d[0], dt[0]])
        np.testing.assert_allclose(v[k], f(z), atol=1e-10)
        np.testing.assert_allclose(np.hstack([J[k] for J in jacobians]), complex_step(f, z), atol=1e-11)


@pytest.mark.parametrize("per", ["block", "strip", "flight"])
def test_groups_follow_the_option(block: Block, per: str) -> None:
    images = replace(block.images, flight=np.where(np.arange(len(block.images)) < 9, "morning", "noon"))
    made = replace(block, images=images)
    found = positions_of(made)
    group = drift_groups(made, found, PositionOptions(per=per))  # type: ignore[arg-type]
    assert len(set(group.tolist())) == {"block": 1, "strip": len(block.strips), "flight": 2}[per]
    assert (drift_groups(made, found, PositionOptions(drift="none", per=per)) == "").all()  # type: ignore[arg-type]


def test_images_without_the_flight_they_are_grouped_by_are_named(block: Block) -> None:
    with pytest.raises(InputError, match="have no flight"):
        drift_groups(block, positions_of(block), PositionOptions(per="flight"))


def _moved(block: Block) -> Block:
    """Positions of antennas 1.2 m away and 0.02 s late; from the truth, by other formulas."""
    truth, e = block.true_images, block.exterior
    assert truth is not None
    time, strip = block.images.time_s, block.images.strip
    position = np.empty((len(e), 3))
    for k, i in enumerate(e.image):
        R, X0 = truth.ground_from_image[i], truth.position_m[i]
        same = np.flatnonzero((strip == strip[i]) & (np.arange(len(time)) != i))
        near = same[np.argmin(np.abs(time[same] - time[i]))]
        u = (truth.position_m[near] - X0) / (time[near] - time[i])
        position[k] = X0 + (R @ ARM if block.images.camera[i] == 0 else 0.0) + OFFSET_S * u
    refers = np.where(block.images.camera[e.image] == 0, ANTENNA, e.refers_to).astype(np.int32)
    return replace(block, exterior=replace(e, position_m=position, refers_to=refers))


def _adjusted(block: Block, **positions: object) -> Solution:
    options = BundleOptions(positions=PositionOptions(**positions))  # type: ignore[arg-type, call-arg]
    return bundle(block, calibrated(block), options=options)


def _value(solution: Solution, name: str, of: str) -> float:
    p = solution.parameters
    return float(p.value[(p.name == name) & (p.object == of)][0])


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [np.inf, 0.5])
def test_lever_arm_and_time_offset_put_in_are_found(block: Block, sigma: float) -> None:
    solution = _adjusted(_free_arm(_moved(block), sigma), drift="none", time_offset=True)
    for camera in "AB":
        assert _value(solution, "time offset", camera) == pytest.approx(OFFSET_S, abs=2e-4)
    found = [_value(solution, f"lever {axis}", "A") for axis in "yz"]
    np.testing.assert_allclose(found, ARM[1:], atol=0.02 if np.isfinite(sigma) else 0.01)
    assert ("lever_arm_prior" in solution.residuals.kind) == bool(np.isfinite(sigma))


@pytest.mark.slow
def test_a_shift_of_the_block_put_in_is_found_and_taken_off(block: Block) -> None:
    s = np.array([1.5, -2.0, 0.7])
    e = block.exterior
    moved = replace(block, exterior=replace(e, position_m=e.position_m + s))
    solution = _adjusted(moved, drift="shift", per="block")
    np.testing.assert_allclose([_value(solution, f"shift {a}", "block") for a in "XYZ"], s, atol=1e-3)
    assert not (solution.parameters.name == "drift X").any()


def test_a_time_offset_without_times_is_refused_by_name(block: Block) -> None:
    images = replace(block.images, time_s=np.full(len(block.images), np.nan))
    with pytest.raises(InputError, match="no velocity"):
        _adjusted(replace(block, images=images), time_offset=True)
