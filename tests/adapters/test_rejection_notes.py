"""What is rejected is told by name and size; exchanged numbers are recognised, mere blunders are not."""

from __future__ import annotations

import numpy as np

from aatri.adapters.rejection_notes import exchanged_control, rejection_notes
from aatri.artifacts.suspects import Suspects


def _suspects() -> Suspects:
    n = 4
    return Suspects(
        kind=np.array(["control", "control", "image_point", "control"]), row=np.arange(n, dtype=np.int32),
        image=np.array(["", "", "i1", ""]), point=np.array(["A", "B", "p", "C"]),
        stage=np.array(["absolute_orientation"] * 3 + ["strip_formation"]), size=np.array([0.5, 2.0, 0.03, 9.0]),
        unit=np.array(["m", "m", "mm", "m"]), sigma=np.full(n, 0.1), test=np.array([5.0, 20.0, 6.0, 90.0]),
        verdict=np.array(["rejected", "rejected", "kept", "rejected"]),
    )  # fmt: skip


def test_rejections_of_the_stage_are_warnings_the_largest_first() -> None:
    (note,) = rejection_notes(_suspects(), "absolute_orientation")
    assert note.level == "warning"
    assert note.text == "control: 2 rejected as gross errors"
    assert note.ids == ("B (2 m, 20 sigma)", "A (0.5 m, 5 sigma)")


def test_exchanged_numbers_are_recognised_and_single_blunders_are_not() -> None:
    found = np.array([[0.0, 0, 0], [500, 0, 10], [0, 400, 5], [500, 400, 8]])
    given = found[[1, 0, 2, 3]] + 0.02
    (note,) = exchanged_control(["A", "B", "C", "D"], found, given, np.array([True, True, False, False]))
    assert "A and B" in note.text
    off = found + np.array([[3.0, 0, 0], [0, 9.0, 0], [0, 0, 0], [0, 0, 0]])
    assert exchanged_control(["A", "B", "C", "D"], found, off, np.array([True, True, False, False])) == []
    heights = np.where([[False, False, True]], given, np.nan)
    assert len(exchanged_control(["A", "B", "C", "D"], found, heights, np.array([True, True, False, False]))) == 1
