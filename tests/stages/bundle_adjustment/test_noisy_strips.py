"""A strip whose image points err by more than those of others is named, and weighted by what they err by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.suspects import Suspects
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation import unordered
from tests.stages.initial_orientation.unordered import SMALL_UAV


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("size", [4.0, 2.4])
def test_a_strip_of_larger_errors_than_others_is_named_and_costs_them_nothing(seed: int, size: float) -> None:
    block = unordered.simulated(seed, **{**SMALL_UAV, "ties": {"random_per_image": 25.0}})
    points, rng = unordered.measured(block), np.random.default_rng(seed)
    m, strip = points.measurements, int(block.images.strip[8])
    noisy = block.images.strip[m.image] == strip
    noise = np.sqrt(size**2 - 1.0) * m.sigma_mm * noisy[:, None] * rng.normal(size=m.xy_mm.shape)
    points = replace(points, measurements=replace(m, xy_mm=m.xy_mm + noise))
    told, initial = Told(), replace(unordered.initial_of(block), suspects=Suspects.empty())
    solution = bundle(block, points, initial, context=told)
    (line,) = [text for text in told.warnings if "its errors are" in text]
    assert f"of strip {block.strips.id[strip]}: " in line
    assert float(line.split("errors are ")[1].split()[0]) == pytest.approx(size, rel=0.2)
    assert solution.remaining_sigma0 == pytest.approx(1.0, abs=0.1)
    assert solution.suspects.staying_out.sum() <= 1
