"""Labels in pictures: within it to the last pixel, and never over each other."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.report.drawing.labels import AWAY_PX, CHARACTER_PX, LINE_PX, Labels
from tests.report.marks import texts


@pytest.mark.parametrize(("off_px", "written"), [(0.0, 1), (0.01, 0)])
@pytest.mark.parametrize(
    ("x", "y", "away"),
    [
        (0.0, 50.0, (-1.0, 0.0)),
        (100.0 - 3 * CHARACTER_PX, 50.0, (1.0, 0.0)),
        (50.0, LINE_PX - 2.0, (0.0, -1.0)),
        (50.0, 98.0, (0.0, 1.0)),
    ],
    ids=["left", "right", "top", "bottom"],
)
def test_a_label_lies_within_the_picture_and_may_touch_its_edge(
    x: float, y: float, away: tuple[float, float], off_px: float, written: int
) -> None:
    labels = Labels(100.0, 100.0)
    assert len(labels.at(x + off_px * away[0], y + off_px * away[1], "abc", "start", "small")) == written


def test_labels_may_touch_each_other_but_not_cover() -> None:
    labels, wide = Labels(200.0, 100.0), 3 * CHARACTER_PX
    assert labels.at(20.0, 50.0, "abc", "start", "small")
    assert labels.at(20.0 + wide, 50.0, "abc", "start", "small")
    assert labels.at(20.0, 50.0 + LINE_PX, "abc", "start", "small")
    assert not labels.at(20.0 + 1.9 * wide, 50.0, "abc", "start", "small")
    assert not labels.at(20.0, 50.0 + 1.9 * LINE_PX, "abc", "start", "small")


def test_a_label_takes_the_first_free_side_and_those_without_room_are_counted() -> None:
    labels = Labels(200.0, 100.0)
    marks, without_room = labels.around(np.full((6, 2), 50.0), ["abc"] * 6)
    assert [("start" in m, "end" in m, "middle" in m) for m in marks] == [
        (True, False, False),
        (False, True, False),
        (False, False, True),
        (False, False, True),
    ]
    assert without_room == 2
    at = [(t.x, t.y) for t in texts("".join(marks))]
    assert at == [(50 + AWAY_PX, 53.0), (50 - AWAY_PX, 53.0), (50.0, 50 - AWAY_PX), (50.0, 50 + AWAY_PX + LINE_PX - 3)]
