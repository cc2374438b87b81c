"""Labels in pictures: within it to the last pixel, and never over each other."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.report.drawing.labels import AWAY_PX, CHARACTER_PX, LINE_PX, Labels

WIDE = 3 * CHARACTER_PX


@pytest.mark.parametrize(("off_px", "written"), [(0.0, 1), (0.01, 0)])
def test_a_label_lies_within_the_picture_and_may_touch_its_edge(off_px: float, written: int) -> None:
    size = (AWAY_PX + WIDE - off_px, LINE_PX + 5.0)  # room on the right, and nowhere else
    assert len(Labels(*size).around(np.array([[0.0, 10.0]]), ["abc"])) == written


def test_a_label_takes_the_first_free_side_and_those_without_room_are_left_out() -> None:
    written = Labels(200.0, 100.0).around(np.full((6, 2), 50.0), ["abc"] * 6)
    assert written == [
        (50 + AWAY_PX, 53.0, "start", "abc"),
        (50 - AWAY_PX, 53.0, "end", "abc"),
        (50.0, 50 - AWAY_PX, "middle", "abc"),
        (50.0, 50 + AWAY_PX + LINE_PX - 3, "middle", "abc"),
    ]


def test_marks_are_not_written_over() -> None:
    labels = Labels(200.0, 100.0)
    labels.keep_free(np.array([[50.0 + AWAY_PX + WIDE, 50.0]]), 4.0)
    assert labels.around(np.array([[50.0, 50.0]]), ["abc"])[0][2] == "end"
