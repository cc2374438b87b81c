"""Standard deviations of image points that are guessed: the stages before the bundle lose no good point to them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.relative_orientation.essential import essential
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told


def flown(factor: float, **options: Any) -> tuple[Any, Any]:
    """A digital block that claims `factor` times its standard deviations."""
    block = simulated(
        5,
        preset="uav",
        flight={"strips": 3, "images_per_strip": 8},
        ties={"new_points": 400},
        known={"full": 8},
        **options,
    )
    m = block.image_points
    block = replace(block, image_points=replace(m, sigma_mm=factor * m.sigma_mm))
    return block, calibrated(block)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("method", [dependent, essential])
@pytest.mark.parametrize("factor", [0.2, 0.5, 2.0, 5.0])
def test_guessed_sigmas_cost_no_good_point(factor: float, method: Any) -> None:
    block, points = flown(factor)
    told = Told()
    models = method(block, points, context=told)
    strips = scale_transfer(block, models)
    absolute = similarity(block, strips, points)
    strip_block = polynomial(block, points, strips, absolute)
    assert len(models.unformed) == 0
    lost = strip_block.suspects.staying_out
    assert lost.sum() <= 0.003 * len(models.model_points), strip_block.suspects.kind[lost]
    if factor < 1:
        [line] = [line for line in told.lines if "times the standard deviations of the image points" in line]
        assert float(line.split("with ")[1].split(" times")[0]) == pytest.approx(1 / factor, rel=0.12)
        assert any("sigma0 of" in text for text in told.warnings)
    true = block.true_points
    off = np.sqrt(np.nanmean((strip_block.points.xyz_m[true.point] - true.xyz_m) ** 2, axis=0))
    assert (off < 0.5).all()


def test_gross_errors_are_still_found_with_guessed_sigmas() -> None:
    block, points = flown(0.5)
    m, rng = points.measurements, np.random.default_rng(4)
    wrong = rng.choice(len(m), len(m) // 50, replace=False)
    xy = m.xy_mm.copy()
    xy[wrong, 0] += rng.choice([-1.0, 1.0], len(wrong)) * 60 * m.sigma_mm[wrong, 0]  # 30 true sigmas across the flight
    models = dependent(block, replace(points, measurements=replace(m, xy_mm=xy)))
    s = models.suspects
    out = set(s.point[s.staying_out].tolist())
    named = set(block.points.id[m.point[wrong]].tolist())
    assert len(out - named) <= 0.003 * len(models.model_points)
    assert len(named & out) > 0.9 * len(named)


def test_sigmas_that_are_right_stay_to_the_bit() -> None:
    told = Told()
    dependent(*flown(1.0), context=told)
    assert not any("times the standard deviations of the image points" in line for line in told.lines)
    assert told.warnings == []
