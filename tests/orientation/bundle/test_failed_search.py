"""A search for gross errors that fails: a block that fits as a whole is not lost, another is refused."""

from __future__ import annotations

from dataclasses import replace

import pytest

from aatri.errors import ConvergenceError
from aatri.orientation.bundle import adjust
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.failed_search import without_search
from aatri.orientation.bundle.blunders.robust import AdjustOptions
from aatri.orientation.bundle.result import BundleResult
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import Parts, settings

FAILURE = ConvergenceError("no convergence in 60 iterations")


def least_squares(block: BundleInput, _: AdjustOptions) -> BundleResult:
    return adjust.adjust_bundle(block, settings(datum="free"))


def test_all_observations_are_used_where_they_fit_and_the_failure_is_a_warning() -> None:
    parts = made_bundle()
    done = without_search(parts.together(), least_squares, FAILURE)
    assert done.result.adjusted.redundancy == 2 * len(parts.rays.image) - 6 * 6 - 3 * 30 + 7
    assert [(note.level, FAILURE.what in note.text) for note in done.notes] == [("warning", True)]


def test_the_failure_stands_where_the_observations_do_not_fit() -> None:
    parts = made_bundle()
    with pytest.raises(ConvergenceError, match="60 iterations"):
        without_search(_wrong(parts).together(), least_squares, FAILURE)


def _wrong(parts: Parts) -> Parts:
    """One image point off by 100 standard deviations."""
    xy_mm = parts.rays.xy_mm.copy()
    xy_mm[0, 0] += 100 * parts.rays.sigma_mm[0, 0]
    return replace(parts, rays=replace(parts.rays, xy_mm=xy_mm))
