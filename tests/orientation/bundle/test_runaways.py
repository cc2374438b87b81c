"""Points that run away along parallel rays are left out with what is undetermined: the block is adjusted once more."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.orientation.bundle import adjust as bundle_adjust
from aatri.orientation.bundle.block import BundleInput
from tests.orientation.bundle.made_bundle import C_MM, SIGMA_MM, made_bundle
from tests.orientation.bundle.parts import settings

SPREAD = 1e-3
"""Angle by which the two rays of the runaway part, ten times what an image point has."""


def _block() -> BundleInput:
    """The made block and two points more in its first two images: one whose rays spread, and one at infinity."""
    parts = made_bundle(start_error=0.0)
    directions = np.array([[-SPREAD, 0, -1], [SPREAD, 0, -1], [0.2, 0.1, -1], [0.21, 0.1, -1]])
    u = np.einsum("nji,nj->ni", parts.poses.ground_from_image[[0, 1, 0, 1]], directions)
    rays = parts.rays
    rays = type(rays)(
        np.r_[rays.image, 0, 1, 0, 1].astype(np.int32),
        np.r_[rays.point, 30, 30, 31, 31].astype(np.int32),
        np.r_[rays.xy_mm, -C_MM * u[:, :2] / u[:, 2:]],
        np.full((len(rays.image) + 4, 2), SIGMA_MM),
        np.full(len(rays.image) + 4, C_MM),
        np.zeros((len(rays.image) + 4, 2)),
        np.ones(len(rays.image) + 4, bool),
    )
    xyz_m = np.r_[parts.xyz_m, [[300.0, 0.0, 0.0], [2e8, 1e8, -1e9]]]
    names = [*parts.point_ids, "runaway", "far"]
    return replace(parts, rays=rays, xyz_m=xyz_m, point_ids=names).together()


def test_a_block_with_an_undetermined_point_and_a_runaway_is_adjusted_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before, nothing determined the runaway where the second adjustment began, and a third one followed."""
    calls, adjust = list[Any](), bundle_adjust.adjust
    monkeypatch.setattr(bundle_adjust, "adjust", lambda *a, **k: (calls.append(a), adjust(*a, **k))[1])
    block = _block()
    result = bundle_adjust.adjust_bundle(block, settings(datum="minimal", tolerance=0.1))
    assert len(calls) == 2
    assert np.flatnonzero(result.set_aside["point"]).tolist() == [30, 31]
    assert any("its rays are parallel: point: runaway" in str(note) for note in result.notes)


def test_what_is_set_aside_is_not_among_the_largest_residuals_of_a_failure() -> None:
    with pytest.raises(ConvergenceError) as raised:
        bundle_adjust.adjust_bundle(_block(), settings(datum="minimal", tolerance=1e-30, max_iterations=3))
    assert "largest residuals" in raised.value.what
    assert "far" not in raised.value.what
