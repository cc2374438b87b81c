"""Several parts, each adjusted by itself with what the others said, one after the other, are the joint adjustment."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.formats.merging.merged import merged
from aatri.formats.merging.part import part_of
from aatri.progress import SILENT
from tests.stages.information.test_reduced import OF_SIGMA, adjusted, apart, block_of_strips, cut, said


def start_of(part: Block, whole: Solution) -> Any:
    """An adjustment of a part that starts from the whole; its values are its own."""
    return replace(
        whole,
        images=whole.images.take(np.isin(whole.images.id, part.images.id)),
        points=whole.points.take(np.isin(whole.points.id, part.points.id)),
        suspects=whole.suspects.take(np.zeros(0, dtype=int)),
    )


def test_parts_one_after_the_other_pass_on_what_the_others_said() -> None:
    block = block_of_strips(False)
    parts = [cut(block, k, k + 2) for k in range(3)]
    joint = adjusted(block)
    start = [start_of(part, joint) for part in parts]
    first = said(parts[0], parts[1], initial=start[0])
    both = said(parts[1], parts[2], first, start[1], include=True)
    assert both.observations > first.observations
    last = adjusted(parts[2], both, start[2])
    assert apart(last, joint) < 1e-3
    assert (last.redundancy, last.observations) == (joint.redundancy, joint.observations)


def chain(parts: list[Block], start: list[Any], **more: Any) -> Solution:
    """The last of several parts adjusted with what all others say, one after the other."""
    last = None
    for k, part in enumerate(parts[:-1]):
        rest = merged_parts(parts[k + 1 :])
        last = said(part, rest, last, start[k], include=True, **more)
    return adjusted(parts[-1], last, start[-1])


def merged_parts(parts: list[Block]) -> Block:
    names = [str(k) for k in range(len(parts))]
    return merged(parts, names, SILENT, name="rest", sigmas=6.0) if len(parts) > 1 else parts[0]


@pytest.mark.slow
@pytest.mark.parametrize("film", [True, False], ids=["film", "digital"])
def test_four_parts_in_any_order_are_the_joint_adjustment(film: bool) -> None:
    block = block_of_strips(film, 4, cross=2)
    quarter = 2 * (block.images.strip >= 2) + (np.arange(len(block.images)) % 4 >= 2)
    parts = [part_of(block, quarter == k) for k in range(4)]
    joint = adjusted(block)
    for order in (parts, [parts[k] for k in (2, 0, 3, 1)]):
        first = chain(order, [None] * 4)
        assert apart(first, joint) < 0.05
        assert (first.redundancy, first.observations) == (joint.redundancy, joint.observations)
        again = chain(order, [start_of(part, joint) for part in order], at_initial=True)
        assert apart(again, joint) < OF_SIGMA
        assert again.sigma0 == pytest.approx(joint.sigma0, rel=1e-9)
