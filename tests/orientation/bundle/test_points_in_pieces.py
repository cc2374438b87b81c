"""What is wrong at points does not depend on how many of them are looked at together."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.bundle import complete_start
from aatri.orientation.bundle.blunders import points
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.stages.chain import run_chain, simulated


@pytest.mark.slow
def test_few_points_at_a_time_give_the_same_rejections(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {"image_points": 0.03, "size_sigmas": [10, 200]}
    flight, ties = {"strips": 2, "images_per_strip": 5}, {"new_points": 150}
    chain = run_chain(simulated(3, preset="rc30", flight=flight, ties=ties, gross_errors=errors))
    together = bundle(chain.block, chain.refined, chain.strip_block)
    monkeypatch.setattr(points, "AT_ONCE", 30)
    monkeypatch.setattr(complete_start, "AT_ONCE", 50)
    in_pieces = bundle(chain.block, chain.refined, chain.strip_block)
    assert together.suspects.staying_out.sum() > 5
    assert in_pieces.suspects.verdict.tolist() == together.suspects.verdict.tolist()
    np.testing.assert_allclose(in_pieces.points.xyz_m, together.points.xyz_m, atol=1e-8)
