"""What a search for gross errors decides at a point, and what it says of what it has left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.observations.positions import Positions
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.rejections import Rejections
from aatri.orientation.bundle.blunders.search_notes import SearchOutcome, findings
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from tests.orientation.bundle.made_bundle import SIGMA_MM, made_bundle
from tests.orientation.bundle.parts import settings


@pytest.mark.parametrize(("off", "stays"), [(10.0, True), (40.0, False)])
def test_two_rays_far_off_each_other_stay_out_beside_errors_of_long_tails(off: float, stays: bool) -> None:
    """A limit that tails make four times as large makes no error four times as small."""
    parts = made_bundle()
    rays = parts.rays
    of_point = np.flatnonzero(rays.point == 7)
    active, xy_mm = rays.active.copy(), rays.xy_mm.copy()
    active[of_point[2:]] = False
    xy_mm[of_point[0], 1] += off * SIGMA_MM
    block = replace(parts, rays=replace(rays, xy_mm=xy_mm, active=active)).together()
    search, tails = Rejections(block, SearchOptions()), 1.5 if stays else 4.0
    use, n = search.all.native & ~search.all.rejected_in(block), len(search.all.native)
    result = adjust_bundle(block, settings(datum="free"))
    test = np.full(n, off / np.sqrt(2) / tails)
    limits = np.full(n, tails)
    wrong = search.gross_errors_at(result, np.array([7]), np.ones(1, dtype=bool), use, test, limits, move=False)
    assert wrong[search.all.point == 7].any() != stays
    assert search.doubtful[7] == stays


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
