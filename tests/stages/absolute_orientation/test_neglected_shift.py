"""Positions whose strips have shifts of their own, and no control: what is neglected is no contradiction."""

from __future__ import annotations

import pytest

from aatri.errors import GeometryError
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told

SHIFTED = {
    "camera": {"kind": "film", "fiducials": 4},
    "flight": {
        "strips": 2,
        "images_per_strip": 5,
        "forward_overlap": 80.0,
        "side_overlap": 60.0,
        "scale_number": 1500.0,
    },
    "terrain": {"relief_m": 20.0},
    "ties": {"per_position": 3},
    "known": {"full": 0},
    "gnss": {"observed": True, "shift_m": 12.0},
    "noise": {"image_um": 2.0},
}


def test_the_bundle_says_what_is_open_and_nobody_is_blamed_before() -> None:
    block, told = simulated(3, **SHIFTED), Told()
    points = systematic(block, affine(block))
    strips = scale_transfer(block, dependent(block, points))
    absolute = similarity(block, strips, points, context=told)
    assert any("shift and drift of positions are neglected" in text for text in [*told.lines, *told.warnings])
    rejected = absolute.suspects.kind[absolute.suspects.verdict == "rejected"]
    assert not (rejected == "position").any()
    start = polynomial(block, points, strips, absolute)
    with pytest.raises(GeometryError, match="shift X of drift") as refused:
        bundle(block, points, start)
    assert "shift of its own" in refused.value.remedy
