"""Geodetic observations that cannot be used: from a station to itself, or a distance that is not positive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.artifacts.block import Block, Geodetic, Rejects

DISTANCES = ("distance", "horizontal_distance")

TO_ITSELF = "from a station to itself"
NOT_POSITIVE = "distance not positive"


def without_unusable(block: Block) -> Block:
    """The Block with such observations switched off, each listed in `rejects` with its reason."""
    rows = block.geodetic
    itself = (rows.start == rows.end) & (rows.start_kind == rows.end_kind)
    short = np.isin(rows.type, DISTANCES) & (rows.value <= 0)
    set_aside = np.flatnonzero((itself | short) & rows.active)
    if not len(set_aside):
        return block
    set_aside = set_aside[np.lexsort((rows.line[set_aside], rows.file[set_aside]))]
    rejects = Rejects.of(
        kind="geodetic", id=[reject_name(rows, k) for k in set_aside.tolist()],
        reason=[TO_ITSELF if itself[k] else NOT_POSITIVE for k in set_aside.tolist()], file=rows.file[set_aside],
        line=rows.line[set_aside],
    )  # fmt: skip
    return replace(block, geodetic=replace(rows, active=rows.active & ~itself & ~short), rejects=rejects)


def reject_name(rows: Geodetic, k: int) -> str:
    """How an observation is called in the list of rejects."""
    return f"{rows.type[k]} {rows.start[k]} {rows.end[k]}"
