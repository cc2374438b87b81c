"""Rigs: derivatives by complex step, exposures with and without their frame, residuals of true poses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.geometry.rotations import exp_rotation
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE, Poses
from aatri.observations.rigs import MOUNT, RigOptions, RigPairs, poses_by_rigs, rig_pairs, rig_records, rigs
from tests.complex_step import complex_step
from tests.stages.chain import simulated

RIG = {
    "left": {"position_m": (0.1, 0.02, -0.03), "angles_deg": (0.0, 40.0, 1.0)},
    "back": {"position_m": (-0.2, 0.0, 0.1), "angles_deg": (-35.0, 0.0, 90.0)},
}


def rigged(seed: int = 2, members: Any = RIG, **options: Any) -> Block:
    """Two strips of three stations with a frame and two oblique cameras."""
    return simulated(
        seed,
        camera={
            "kind": "digital",
            "format": (8000.0, 6000.0),
            "pixel_size_mm": 0.005,
            "margin_mm": 0.0,
            "principal_distance_mm": 50.0,
        },
        flight={"strips": 2, "images_per_strip": 3, "scale_number": 20_000.0},
        refraction="none",
        ties={"per_position": 3, "random_per_image": 30.0},
        known={"full": 4, "check_full": 4},
        rig=members,
        **options,
    )


def test_derivatives_are_those_of_the_residual_by_complex_step() -> None:
    rng = np.random.default_rng(6)
    mount = exp_rotation(rng.normal(size=(3, 3)))
    pairs = RigPairs(*(np.array(a, np.int32) for a in ([0, 0], [1, 2], [0, 2], [1, 1])), mount)
    R, X, mounts = exp_rotation(rng.normal(size=(3, 3))), rng.normal(size=(3, 3)), 0.3 * rng.normal(size=(3, 6))
    state: dict[str, Any] = {POSE: Poses(X, R), MOUNT: mounts}
    for records in rig_records(pairs, 1.0, 1.0):
        _, J = records.evaluate(state, np.arange(2))
        for row in range(2):
            for slot, (group, blocks) in enumerate(records.touches):
                k = int(blocks[row])

                def moved(step: Any, group: str = group, k: int = k, row: int = row, records: Any = records) -> Any:
                    x, turned, m = X.astype(complex), R.astype(complex), mounts.astype(complex)
                    if group == MOUNT:
                        m[k] = m[k] + step
                    else:
                        x[k] = x[k] + step[:3]
                        turned[k] = exp_rotation(step[None, 3:])[0] @ R[k]
                    return records.evaluate({POSE: Poses(x, turned), MOUNT: m}, np.array([row]))[0]

                np.testing.assert_allclose(J[slot][row], complex_step(moved, np.zeros(6)), atol=1e-10)


def test_true_poses_have_no_residuals_and_give_those_of_the_other_members() -> None:
    block = rigged(noise=False)
    assert block.true_images is not None
    poses = Poses(block.true_images.position_m, block.true_images.ground_from_image)
    found = rigs(ObservationSource(block, None, np.zeros(3), {POSE: poses}), RigOptions())
    for o in found:
        v, _ = o.records.evaluate({POSE: poses, **found[0].start}, np.arange(len(o)))
        assert np.abs(v).max() < 1e-9
        assert len(o) == 12
    lost = np.char.endswith(block.images.id, "left")
    known = Poses(np.where(lost[:, None], np.nan, poses.position_m), poses.ground_from_image)
    again = poses_by_rigs(block, known)
    np.testing.assert_allclose(again.position_m, poses.position_m, atol=1e-9)


def test_an_exposure_without_its_frame_ties_its_members_to_each_other() -> None:
    block = rigged(noise=False)
    assert block.true_images is not None
    frames = block.images.member == "frame"
    without = replace(block, images=replace(block.images, active=~frames))
    pairs = rig_pairs(without)
    assert len(pairs.first) == 6
    assert not frames[pairs.first].any()
    poses = Poses(block.true_images.position_m, block.true_images.ground_from_image)
    for o in rigs(ObservationSource(without, None, np.zeros(3), {POSE: poses}), RigOptions()):
        start = np.concatenate([block.rig_members.position_m, np.zeros((3, 3))], axis=1)
        v, _ = o.records.evaluate({POSE: poses, MOUNT: start}, np.arange(len(o)))
        assert np.abs(v).max() < 1e-9
