"""What a search for gross errors says of what it has left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.observations.positions import Positions
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.search_notes import SearchOutcome, findings
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from tests.orientation.bundle.made_bundle import made_bundle


@pytest.mark.parametrize(("out", "text"), [(5, "left out together"), (2, "rejected as gross errors")])
def test_a_kind_of_which_most_has_come_back_is_not_said_to_disagree(out: int, text: str) -> None:
    parts = made_bundle()
    n = len(parts.image_ids)
    row, C = np.arange(n, dtype=np.int32), np.tile(1e-4 * np.eye(3), (n, 1, 1))
    positions = Positions(row, row, parts.poses.position_m, C, np.zeros((n, 3)))
    block = replace(parts, positions=positions).together()
    records = AllRecords.of(block)
    (of_positions,) = (part for part, o in zip(records.parts, block.observed) if o.kind == "position")
    active, left_out = records.native.copy(), np.zeros(len(records.native), dtype=bool)
    active[of_positions] = np.arange(n) >= out
    left_out[of_positions] = True
    none = np.zeros_like(left_out)
    outcome = SearchOutcome(active, none, none, none, rejected_kinds=left_out)
    (note,) = findings(block, records, outcome, SearchOptions())
    assert text in note.text
