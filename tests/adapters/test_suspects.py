"""What a stage inherits of the rejections of earlier ones."""

from __future__ import annotations

import pytest

from aatri.adapters.suspects import inherited
from tests.stages.chain import run_chain, simulated


@pytest.mark.slow(after=1)
def test_some_positions_that_are_wrong_stay_out_though_the_strip_block_adjusts_none() -> None:
    """It has no residuals of positions, in use or not: the two that the absolute orientation rejects are not all."""
    flight = {"strips": 2, "images_per_strip": 5}
    gross_errors = {"positions": 2, "size_sigmas": [100, 200]}
    chain = run_chain(simulated(3, preset="rc30", flight=flight, gross_errors=gross_errors))
    initial = chain.strip_block
    assert not len(initial.residuals.of_kind("position"))
    suspects, _ = inherited(chain.block, initial)
    assert suspects.verdict[suspects.kind == "position"].tolist() == ["rejected", "rejected"]
