"""Errors of free strips: what was put in comes out, and the laws are the variances of the sums they stand for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.geometry.rotations import exp_rotation
from aatri.stages.accuracy.free_strips import free_strips
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated


@pytest.fixture(scope="module")
def made() -> tuple[Any, Any]:
    """Two error-free strips of five models and their free strips."""
    block = simulated(
        2,
        preset="sample",
        flight={"strips": 2, "images_per_strip": 6},
        known={"layout": (), "full": 4},
        ties={"per_position": 3},
        refraction="none",
        noise={"factor": 0.0},
    )
    return block, scale_transfer(block, dependent(block, calibrated(block)))


def test_error_free_strips_have_no_errors(made: Any) -> None:
    table = free_strips(*made).strip_errors
    assert table.model.tolist() == [1, 2, 3, 4, 5]
    assert table.strips.tolist() == [2] * 5
    assert np.abs(table.rms).max() < 1e-6
    assert np.abs(table.turned_rad).max() < 1e-6


def test_an_error_put_into_one_strip_comes_out_at_its_model_in_the_axes_of_the_ground(made: Any) -> None:
    """The third projection centre of the second strip moves by (0.03, 0, -0.04) bases, its image turns by 1 mrad."""
    block, strips = made
    rows = np.flatnonzero(strips.strip_images.strip == 1)
    first = strips.strip_images.image[rows[0]]
    truth = block.true_images
    R = truth.ground_from_image[np.flatnonzero(truth.image == first)[0]]
    strip_from_ground = strips.strip_images.strip_from_image[rows[0]] @ R.T
    position, turn = strips.strip_images.position.copy(), strips.strip_images.strip_from_image.copy()
    position[rows[3]] += strip_from_ground @ [0.03, 0.0, -0.04]
    about = np.array([0.0, 1e-3, 0.0])
    turn[rows[3]] = strip_from_ground @ exp_rotation(about) @ strip_from_ground.T @ turn[rows[3]]
    off = replace(strips, strip_images=replace(strips.strip_images, position=position, strip_from_image=turn))
    table = free_strips(block, off).strip_errors
    assert table.mean[2] == pytest.approx([0.015, 0.0, -0.02], abs=1e-6)
    assert table.rms[2] == pytest.approx(np.abs([0.03, 0.0, -0.04]) / np.sqrt(2), abs=1e-6)
    assert table.turned_rad[2] == pytest.approx(np.array([0.0, 1e-3, 0.0]) / np.sqrt(2), abs=1e-6)
    assert np.abs(table.rms[[0, 1, 3, 4]]).max() < 1e-6


def test_the_laws_are_the_standard_deviations_of_the_sums(made: Any) -> None:
    """Against n d1 + ... + dn: sqrt(1 + 4 + ... + n^2); fitted, only the ratios between the models count."""
    block, strips = made
    noisy = replace(
        strips,
        strip_images=replace(
            strips.strip_images,
            position=strips.strip_images.position
            + np.random.default_rng(1).normal(0, 1e-3, strips.strip_images.position.shape),
        ),
    )
    table = free_strips(block, noisy).strip_errors
    n = np.arange(1, 6)
    sums = np.sqrt(np.cumsum(n**2.0))
    assert table.law[:, 2] / table.law[0, 2] == pytest.approx(sums, rel=1e-12)
    assert table.turned_law_rad[:, 1] / table.turned_law_rad[0, 1] == pytest.approx(np.sqrt(n), rel=1e-12)
    assert (table.law[:, 2] - table.rms[:, 2]) @ sums == pytest.approx(0.0, abs=1e-12)  # least squares


def test_without_truth_it_says_so(made: Any) -> None:
    block, strips = made
    with pytest.raises(InputError, match="no true orientations"):
        free_strips(replace(block, true_images=None), strips)
