"""Where a bundle starts that has neither `initial` nor positions: resection to its control."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block, Exterior
from aatri.errors import GeometryError
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.chain import simulated

OFF = SystematicOptions(refraction=False, earth_curvature=False)
CAMERA = {"kind": "digital", "format": (6000.0, 6000.0), "pixel_size_mm": 0.01, "principal_distance_mm": 60.0}


def _without_exterior(control: int) -> Block:
    block = simulated(1, camera=CAMERA, flight={"strips": 2, "images_per_strip": 3}, known={"full": control})
    return replace(block, exterior=Exterior.empty())


def test_a_block_of_control_alone_starts_by_resection_of_every_image() -> None:
    block = _without_exterior(30)
    solution = bundle(block, systematic(block, calibrated(block)))
    assert solution.images.oriented.all()
    truth = block.true_images
    assert truth is not None
    error = solution.images.position_m[truth.image] - truth.position_m
    sigma = np.sqrt(np.einsum("nii->ni", solution.images.covariance))[:, :3]
    assert (np.abs(error) < 5 * sigma + 0.01).all()
    assert 0.8 < solution.sigma0 < 1.2


def test_with_too_little_control_in_every_image_what_is_missing_is_said() -> None:
    block = _without_exterior(3)
    with pytest.raises(GeometryError, match="none sees four control points"):
        bundle(block, systematic(block, calibrated(block), options=OFF))
