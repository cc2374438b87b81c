"""Attitudes take part in the datum of strips where control and positions leave something open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told

MAP = {"earth": "geodetic", "false_origin_m": (446000.0, 4505000.0)}


@pytest.mark.parametrize("earth", [{}, MAP])
@pytest.mark.parametrize(("control", "positions"), [(2, 0), (1, 1), (0, 2)])
def test_a_line_of_control_and_attitudes_is_a_datum(control: int, positions: int, earth: dict[str, Any]) -> None:
    block = simulated(
        3,
        flight={"strips": 2, "images_per_strip": 5},
        known={"full": control},
        **earth,
        gnss={"observed": True},
        imu={"observed": True},
    )
    use = block.exterior.position_use.copy()
    use[positions:] = 0
    block = replace(block, exterior=replace(block.exterior, position_use=use))
    points = affine(block)
    strips = scale_transfer(block, dependent(block, points))
    told = Told()
    absolute = similarity(block, strips, points, context=told)
    assert any("attitudes of 10 images take part, as control and positions leave it open" in x for x in told.lines)
    assert block.true_images is not None
    found = polynomial(block, points, strips, absolute)
    for solution in (absolute, found):
        off = np.sqrt(((solution.images.position_m - block.true_images.position_m) ** 2).mean(axis=0))
        assert (off < 1.0).all(), off
    without = replace(block.exterior, angle_use=np.zeros(len(use), dtype=np.int32))
    with pytest.raises(GeometryError, match="not determined"):
        similarity(replace(block, exterior=without), strips, points)
