"""Rigs in the bundle: mounts fixed, weighted and free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.checks.at_start.mounts import mount_conventions
from aatri.geometry.rotations import angles_from_rotation
from aatri.observations.poses import POSE, Poses
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.observations.test_rigs import RIG, rigged
from tests.stages.geodetic_blocks import figures


def started(block: Block) -> Block:
    """With starting angles of the frames alone: the members get theirs by the rig."""
    assert block.true_images is not None
    image = block.exterior.image
    angles = angles_from_rotation(block.true_images.ground_from_image)[image]
    angles = angles + 1e-4 * np.random.default_rng(0).standard_normal(angles.shape)
    return replace(block, exterior=replace(block.exterior, angles_rad=angles))


def adjusted(block: Block, **options: Any) -> Solution:
    block = started(block)
    return bundle(block, calibrated(block), options=BundleOptions.model_validate(options))


def made(seed: int, **changed: Any) -> Block:
    """The block with members whose place and angles the block gives otherwise."""
    return rigged(seed, {name: member | changed for name, member in RIG.items()})


@pytest.mark.slow
def test_fixed_mounts_hold_and_the_block_is_as_accurate_as_theory_says() -> None:
    nees = []
    for seed in range(1, 4):
        block = made(seed)
        solution = adjusted(block)
        assert solution.images.oriented.all()
        assert not (solution.parameters.group == "mount").any()
        kinds = solution.residuals.kind
        away = solution.residuals.residual[kinds == "rig position"]
        assert np.abs(away).max() < 5e-4  # 5 um at 50 mm are 0.1 m on the ground, a 200th is the standard deviation
        assert 0.9 < solution.sigma0 < 1.1
        nees.append(figures(block, solution)["truth_nees"])
    assert 0.6 < np.mean(nees) < 1.5


@pytest.mark.slow
def test_free_mounts_are_recovered_within_their_sigma() -> None:
    w = []
    for seed in range(1, 4):
        block = made(seed, free=True, error_m=(0.02, -0.01, 0.01), error_deg=(0.2, 0.1, -0.3))
        solution = adjusted(block)
        p = solution.parameters
        mine = p.group == "mount"
        place = mine & np.isin(p.name, ["mount X", "mount Y", "mount Z"])
        assert (mine.sum(), place.sum()) == (12, 6)
        true = np.concatenate([RIG[name.split("/")[1]]["position_m"] for name in np.unique(p.object[mine])])
        w.append((p.value[place] - true) / p.sigma[place])
    assert 0.35 < np.mean(np.square(w)) < 2.06  # chi-square over 18 degrees of freedom, 99 %


def test_weighted_mounts_are_observations_of_their_own() -> None:
    block = made(1, sigma_m=0.02, sigma_deg=0.2, error_m=(0.02, -0.01, 0.01), error_deg=(0.2, 0.1, -0.3))
    solution = adjusted(block)
    assert (solution.residuals.kind == "mount_prior").sum() == 12
    assert 0.9 < solution.sigma0 < 1.1


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda angles: -angles, "of opposite sign"),
        (lambda angles: 1000 * angles, "thousandths of the unit declared"),
        (lambda angles: angles + 0.003, ""),
    ],
)
def test_mounts_in_another_convention_are_told_with_it_before_the_adjustment(
    change: Callable[[np.ndarray], np.ndarray], what: str
) -> None:
    block = rigged(1)
    true, members = block.true_images, block.rig_members
    assert true is not None
    state = {POSE: Poses(true.position_m, true.ground_from_image)}
    assert not mount_conventions(block, state)
    findings = mount_conventions(
        replace(block, rig_members=replace(members, angles_rad=change(members.angles_rad))), state
    )
    assert len(findings) == (2 if what else 0)
    assert all(what in str(f) and f.level == "error" for f in findings)


@pytest.mark.parametrize(
    ("true_deg", "declared_deg", "sigma_deg", "remedy"),
    [
        (-0.7, 0.75, 0.0, "omega, phi, kappa of 0, -0.75, 0 deg"),
        (-0.7, 0.75, 2.0, ""),
        (-40.0, 40.0, 2.0, "omega, phi, kappa of 0, -40, 0 deg"),
        (0.2, 30.0, 0.0, ""),  # in thousandths 0.03, which is as good as none
        (0.2, 200.0, 0.0, "omega, phi, kappa of 0, 0.2, 0 deg"),
    ],
)
def test_a_mount_is_refused_beyond_its_sigmas_and_with_a_reading_better_than_none(
    true_deg: float, declared_deg: float, sigma_deg: float, remedy: str
) -> None:
    block = rigged(1, {"left": {"position_m": (0.1, 0.0, 0.0), "angles_deg": (0.0, true_deg, 0.0)}})
    true, members = block.true_images, block.rig_members
    assert true is not None
    angles = np.where(members.angles_rad != 0, np.radians(declared_deg), 0.0)
    changed = replace(members, angles_rad=angles, angle_sigma_rad=np.full_like(angles, np.radians(sigma_deg)))
    findings = mount_conventions(
        replace(block, rig_members=changed), {POSE: Poses(true.position_m, true.ground_from_image)}
    )
    assert len(findings) == bool(remedy)
    assert all(remedy in f.remedy for f in findings)


@pytest.mark.slow
def test_a_wrong_fixed_mount_shows_in_sigma0_and_rigs_can_be_set_aside() -> None:
    block = made(1, error_deg=(0.2, 0.1, -0.3))
    off = adjusted(block, max_sigma0=1e6, blunders="none")
    assert off.sigma0 > 5
    assert 0.85 < adjusted(block, rigs={"use": False}).sigma0 < 1.15
