"""Strips of a camera whose principal distance is wrong: they are left out by name, and the bundle says what it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told


@pytest.mark.slow
def test_the_camera_of_two_whose_principal_distance_is_wrong_by_a_quarter_is_named() -> None:
    block = simulated(3, preset="uav", flight={"strips": 5, "images_per_strip": 5}, known={"full": 9})
    cameras = block.cameras.take(np.array([0, 0]))
    c_mm = cameras.principal_distance_mm * [1.0, 1.25]
    second = np.isin(block.images.strip, [1, 3])
    block = replace(
        block,
        cameras=replace(cameras, id=np.array(["first", "second"]), principal_distance_mm=c_mm),
        images=replace(block.images, camera=second.astype(block.images.camera.dtype)),
    )
    told = Told()
    points = systematic(block, calibrated(block))
    strips = scale_transfer(block, dependent(block, points))
    absolute = similarity(block, strips, points, context=told)
    (line,) = [text for text in told.warnings if "strips of different cameras contradict each other" in text]
    assert line.endswith("left out are those of camera second, whose principal distance may be wrong: 2, 4")
    assert (absolute.images.oriented == ~second).all()
    told = Told()
    bundle(block, points, polynomial(block, points, strips, absolute), context=told)
    line = next(text for text in told.warnings if "contradicts its own tests" in text)
    assert "image points of camera second ask for a principal distance" in line
