"""Good observations whose errors have long tails are not taken for gross; two rays that were lost are asked again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from aatri.artifacts.solution import Solution
from tests.campaigns.false_alarms import KINDS, left_out
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.judged import Ear, read, through


def _solution(kind: str, way: str, seed: int) -> Solution:
    cell, ear = replace(KINDS[kind], seed=seed, noise="t5"), Ear()
    made = through(cell, read(scene_of(cell), ear), way, ear)["bundle"]
    assert isinstance(made, Solution)
    return made


@pytest.mark.parametrize("way", ["chain", "graph"])
def test_student_errors_are_no_gross_errors(way: str) -> None:
    """Four blocks of some 350 image points; with the limit of normal errors 1 to 3 of each are left out."""
    assert sum(left_out(_solution("film", way, seed).suspects) for seed in (1, 2, 3, 5)) == 0


def test_points_lost_with_an_earlier_rejection_come_back() -> None:
    """The graph leaves a point of two rays out altogether: the block, which knows the tail, takes it."""
    assert _solution("film", "graph", 2).suspects.verdict.tolist() == ["readmitted"] * 2
