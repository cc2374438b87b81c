"""Relative orientation by named points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.connected import ConnectedOptions, connected
from aatri.stages.relative_orientation.dependent import ClassicalOptions, dependent
from aatri.stages.relative_orientation.essential import EssentialOptions, essential
from aatri.stages.relative_orientation.independent import independent
from tests.stages.chain import calibrated, simulated, systematic

METHODS = [(dependent, ClassicalOptions), (independent, ClassicalOptions), (essential, EssentialOptions)]


@pytest.mark.parametrize(("method", "options"), METHODS)
def test_points_not_named_are_intersected_and_do_not_orient(tmp_path: Path, method: Any, options: Any) -> None:
    block = simulated(preset="sample")
    refined = systematic(block, calibrated(block))
    points = tmp_path / "orientation_points.txt"
    left_out = block.points.id[3]
    points.write_text("\n".join(i for i in block.points.id if i != left_out))
    some = method(block, refined, options=options(orientation_points=points))
    every = method(block, refined)
    assert len(some.model_points) == len(every.model_points)
    assert np.bincount(some.model_points.point)[3] == np.bincount(every.model_points.point)[3]
    has = np.isin(np.arange(len(every.orientations)), every.model_points.model[every.model_points.point == 3])
    assert (some.orientations.redundancy == every.orientations.redundancy - has).all()
    same = np.isclose(some.orientations.base, every.orientations.base, rtol=0, atol=1e-14).all(axis=1)
    assert (same == ~has).all()


def test_connection_points_connect_whether_they_are_named_or_not(tmp_path: Path) -> None:
    """Of the notes: orientation points give Q, connection points P and Q."""
    flight = {"strips": 1, "images_per_strip": 5, "cross_strips": 0}
    block = simulated(2, preset="rc30", flight=flight, ties={"new_points": 200})
    refined = systematic(block, affine(block))
    every = connected(block, refined)
    models = np.zeros(len(block.points), dtype=int)
    for k in range(len(every.orientations)):
        models[np.unique(every.model_points.point[every.model_points.model == k])] += 1
    single = np.flatnonzero(models == 1)
    points = tmp_path / "names.txt"
    points.write_text("\n".join(np.delete(block.points.id, single[::2])))
    some = connected(block, refined, options=ConnectedOptions(orientation_points=points))
    p = every.model_points
    unnamed = np.bincount(p.model[np.isin(p.point, single[::2]) & p.active], minlength=len(every.orientations))
    assert unnamed.all()
    assert (every.orientations.redundancy - some.orientations.redundancy >= unnamed - 2).all()
    assert (every.orientations.redundancy - some.orientations.redundancy <= unnamed + 2).all()
    sigma = np.sqrt(np.einsum("nii->ni", some.orientations.covariance))
    assert (np.abs(some.orientations.base - every.orientations.base).max(axis=1) < 3 * sigma.max(axis=1)).all()


def test_a_name_that_no_point_has_is_refused(tmp_path: Path) -> None:
    block = simulated(preset="sample")
    (tmp_path / "names.txt").write_text("11 nobody\n")
    with pytest.raises(InputError, match="nobody"):
        dependent(
            block,
            systematic(block, calibrated(block)),
            options=ClassicalOptions(orientation_points=tmp_path / "names.txt"),
        )
