"""Behind the bundle's door there are arrays: few calls receive the whole block."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from types import FrameType
from typing import Any

from aatri.artifacts.block import Block
from aatri.observations.observed import ObservationSource
from aatri.orientation.bundle.block import BundleInput
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.stages.chain import run_chain, simulated

HOUSE = tuple(f"{Path(__file__).parents[3] / top}/" for top in ("aatri", "stages"))
WHOLE = (Block, ObservationSource, BundleInput)


def test_few_calls_receive_the_whole_block() -> None:
    """At most 150 calls in 60 modules, of a block without gross errors; a method of the block is a call, too."""
    flight = {"strips": 2, "images_per_strip": 5}
    chain = run_chain(simulated(3, preset="rc30", flight=flight, ties={"new_points": 300}))
    calls: list[str] = []
    generators: set[FrameType] = set()  # one that goes on is no call; kept, so that no other takes its place

    def note(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(HOUSE) and frame is not here:
            arguments = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
            if any(isinstance(frame.f_locals.get(name), WHOLE) for name in arguments):
                if not code.co_flags & inspect.CO_GENERATOR or frame not in generators:
                    calls.append(code.co_filename)
                generators.add(frame)

    here = inspect.currentframe()
    sys.setprofile(note)
    try:
        bundle(chain.block, chain.refined, chain.strip_block)
    finally:
        sys.setprofile(None)
    assert 60 < len(calls) <= 150
    assert len(set(calls)) <= 60
