"""Relative orientation by named points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.stages.relative_orientation.dependent import ClassicalOptions, dependent
from tests.stages.chain import calibrated, simulated, systematic


def test_points_not_named_are_intersected_and_do_not_orient(tmp_path: Path) -> None:
    block = simulated(preset="sample")
    refined = systematic(block, calibrated(block))
    points = tmp_path / "orientation_points.txt"
    left_out = block.points.id[3]
    points.write_text("\n".join(i for i in block.points.id if i != left_out))
    some = dependent(block, refined, options=ClassicalOptions(orientation_points=points))
    every = dependent(block, refined)
    assert len(some.model_points) == len(every.model_points)
    assert np.bincount(some.model_points.point)[3] == np.bincount(every.model_points.point)[3]
    has = np.isin(np.arange(len(every.orientations)), every.model_points.model[every.model_points.point == 3])
    assert (some.orientations.redundancy == every.orientations.redundancy - has).all()
    same = np.isclose(some.orientations.base, every.orientations.base, rtol=0, atol=1e-14).all(axis=1)
    assert (same == ~has).all()


def test_a_name_that_no_point_has_is_refused(tmp_path: Path) -> None:
    block = simulated(preset="sample")
    (tmp_path / "names.txt").write_text("11 nobody\n")
    with pytest.raises(InputError, match="nobody"):
        dependent(
            block,
            systematic(block, calibrated(block)),
            options=ClassicalOptions(orientation_points=tmp_path / "names.txt"),
        )
