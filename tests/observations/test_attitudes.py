"""Observed attitudes: derivatives by complex step, and residuals of error-free attitudes in every convention."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.adapters.frame.adjustment_frame import frame_of, geodesy_of, poses_into
from aatri.artifacts.block import Block
from aatri.geometry.rotations import exp_rotation
from aatri.observations.attitudes import (
    ATTITUDE_DRIFT,
    BORESIGHT,
    AttitudeOptions,
    Attitudes,
    ObservedAngles,
    attitude_records,
    attitudes,
)
from aatri.observations.drift import drift_term, with_terms
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE, Poses
from tests.complex_step import complex_step
from tests.stages.chain import simulated

SYSTEMS = ("omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading")


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("size", [1e-3, 1.0])
def test_derivatives_are_those_of_the_residual_by_complex_step(system: str, size: float) -> None:
    rng = np.random.default_rng(2)
    n = 3
    angles = rng.uniform(-0.6, 0.6, (n, 3))
    some = exp_rotation(rng.normal(size=(3 * n, 3)))
    given = ObservedAngles(angles, system, some[:n], np.array([0, 90, 180]))
    observed, G = given.rotations()
    B, b = some[2 * n :], 0.3 * size * rng.normal(size=(2, 3))
    rotation = B @ exp_rotation(size * rng.normal(size=(n, 3)) / 2) @ observed
    camera, group, time = np.array([0, 1, 0]), np.array([0, 0, 1], np.int32), rng.normal(size=n)
    rows = Attitudes(np.arange(n), np.arange(n), camera, observed, G, np.full((n, 3), 0.1), B)
    term = drift_term(np.array(list("aab")), time, name=ATTITUDE_DRIFT)
    records = with_terms(attitude_records(rows), [term])
    state: dict[str, Any] = {
        POSE: Poses(np.zeros((n, 3)), rotation),
        BORESIGHT: b,
        ATTITUDE_DRIFT: rng.normal(size=(2, 6)),
    }
    _, J = records.evaluate(state, np.arange(n))
    for k in range(n):
        row = np.array([k])

        def by_pose(step: Any, row: Any = row, k: int = k) -> Any:
            turned = rotation.astype(complex)
            turned[k] = exp_rotation(step[None, 3:])[0] @ rotation[k]
            return records.evaluate({**state, POSE: Poses(np.zeros((n, 3)), turned)}, row)[0]

        def by_boresight(value: Any, row: Any = row, k: int = k) -> Any:
            turned = b.astype(complex)
            turned[camera[k]] = value
            return records.evaluate({**state, BORESIGHT: turned}, row)[0]

        def by_drift(value: Any, row: Any = row, k: int = k) -> Any:
            drift = state[ATTITUDE_DRIFT].astype(complex)
            drift[group[k]] = value
            return records.evaluate({**state, ATTITUDE_DRIFT: drift}, row)[0]

        np.testing.assert_allclose(J[0][k], complex_step(by_pose, np.zeros(6)), atol=1e-10)
        np.testing.assert_allclose(J[1][k], complex_step(by_boresight, b[camera[k]]), atol=1e-10)
        np.testing.assert_allclose(J[2][k], complex_step(by_drift, state[ATTITUDE_DRIFT][group[k]]), atol=1e-10)


def error_free(**imu: Any) -> Block:
    """A block of eight images whose attitudes have no errors, in UTM far from its central meridian."""
    return simulated(
        3,
        noise=False,
        earth="geodetic",
        false_origin_m=(760_000.0, 4_505_000.0),
        refraction="none",
        flight={"strips": 2, "images_per_strip": 4, "kappa_sigma_deg": 5.0},
        ties={"per_position": 1},
        known={"full": 4},
        imu={"observed": True, "boresight_deg": (0.3, -0.2, 1.0), **imu},
    )


@pytest.mark.parametrize("curvature", ["frame", "correct"])
@pytest.mark.parametrize("mounting_deg", [0, 90, 180, 270])
@pytest.mark.parametrize(("system", "heading"), [*((s, "true") for s in SYSTEMS), ("roll-pitch-heading", "grid")])
def test_attitudes_without_errors_have_no_residuals(
    system: str, heading: str, mounting_deg: int, curvature: str
) -> None:
    block = simulated(
        3,
        noise=False,
        earth="geodetic",
        false_origin_m=(760_000.0, 4_505_000.0),
        refraction="none",
        flight={"strips": 2, "images_per_strip": 4, "kappa_sigma_deg": 5.0},
        ties={"per_position": 1},
        known={"full": 4},
        camera={"mounting_deg": mounting_deg},
        imu={"observed": True, "boresight_deg": (0.3, -0.2, 1.0), "rotation": system, "heading": heading},
    )
    block = replace(block, earth_curvature=curvature)
    frame = frame_of(block)
    assert block.true_images is not None
    poses = poses_into(frame, block.true_images.position_m, block.true_images.ground_from_image)
    given = ObservationSource(block, None, np.zeros(3), {POSE: poses}, frame=frame, geodesy=geodesy_of(block, frame))
    (found,) = attitudes(given, AttitudeOptions())
    v, _ = found.records.evaluate({POSE: poses, BORESIGHT: block.cameras.boresight_rad}, np.arange(8))
    assert np.abs(v).max() < 1e-8
