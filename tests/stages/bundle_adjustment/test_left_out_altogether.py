"""Positions or control that an earlier stage has left out altogether: when a bundle does without them, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.observations.control import Control
from aatri.observations.positions import Positions
from aatri.orientation.bundle import adjust
from aatri.orientation.bundle.groups.candidates import ALL, NEIGHBOURHOOD
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.groups.search import AcceptedGroup
from aatri.stages.bundle_adjustment import _adjusted
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.orientation.bundle.made_bundle import made_bundle, no_positions
from tests.orientation.bundle.parts import adjust_bundle, settings
from tests.stages.bundle_adjustment.test_bundle_input import CORNERS, OF, exterior_rows
from tests.stages.hand_block import angles_deg, ground_rows, read, start, suspected


@pytest.mark.parametrize(("kind", "per", "adjustments"), [("position", ALL, 1), ("image_point", NEIGHBOURHOOD, 2)])
def test_control_left_out_is_explained_by_a_group_of_positions_not_by_a_neighbourhood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, per: str, adjustments: int
) -> None:
    adjusted, made, three = _adjusted.adjusted_block, list[int](), np.ones(3)
    rows = np.arange(6)
    group = Group(0, kind, per, "p1", "shift", rows, np.zeros((6, 3, 3)), three, three, 99.0, 1.0)

    def with_group(*given: Any) -> Any:
        made.append(1)
        done, _, components = adjusted(*given)
        return done, (AcceptedGroup(group, True),), components

    monkeypatch.setattr(_adjusted, "adjusted_block", with_group)
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), OF.position_m, ",0.1,0.1,0.1", ",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior=exterior)
    bundle(block, points, start(OF, block, suspected("control", range(len(CORNERS)))))
    assert len(made) == adjustments


@pytest.mark.parametrize(("off_m", "sigma_m", "far_better"), [(60.0, 3.0, False), (20.0, 0.1, True)])
def test_all_else_fits_far_better_where_it_does_itself(off_m: float, sigma_m: float, far_better: bool) -> None:
    """Positions that do not fit each other spoil sigma0; only those of high weight bend the block."""
    parts, image = made_bundle(start_error=0.0), np.arange(6, dtype=np.int32)
    off = off_m * np.random.default_rng(1).normal(size=(6, 3))
    C = np.broadcast_to(sigma_m**2 * np.eye(3), (6, 3, 3))
    parts = replace(parts, positions=Positions(image, image, parts.poses.position_m + off, C, np.zeros((6, 3))))
    beside = adjust_bundle(parts)
    without = adjust_bundle(replace(parts, positions=no_positions()), datum="free")
    assert without.adjusted.sigma0 < 0.5 * beside.adjusted.sigma0
    assert _adjusted.fits_far_better(without, beside, parts.together().observed, ["position"]) == far_better


@pytest.mark.parametrize(("lost", "spoils"), [(5, True), (3, True), (2, False)])
def test_positions_that_are_left_out_in_the_end_do_not_keep_rays_out_that_they_spoiled(lost: int, spoils: bool) -> None:
    """By one ray or two differ two searches of the same block."""
    parts = made_bundle(start_error=0.0)
    block = parts.together()
    rays, *others = (o.without(np.full(len(o), o.kind == "position")) for o in block.observed)
    spoiled = rays.without(np.arange(len(rays)) < lost)
    without, beside = (
        adjust.adjust_bundle(replace(block, observed=(first, *others)), settings(datum="free"))
        for first in (rays, spoiled)
    )
    assert _adjusted.spoils_others(without, beside, block.observed, ["position"]) == spoils
    assert not _adjusted.spoils_others(beside, without, block.observed, ["position"])


@pytest.mark.parametrize("kind", ["position", "control"])
def test_what_is_used_and_fits_or_holds_exactly_spoils_nothing(kind: str) -> None:
    parts, row = made_bundle(start_error=0.0), np.arange(4, dtype=np.int32)
    C, all_three = np.broadcast_to(0.01 * np.eye(3), (4, 3, 3)), np.ones((4, 3), dtype=bool)
    exact = Control(row, row, parts.xyz_m[row], 0.0 * C, ~all_three, all_three)
    positions = Positions(row, row, parts.poses.position_m[row], C, np.zeros((4, 3)))
    block = replace(parts, control=exact, positions=positions).together()
    rays, *others = block.observed
    without, beside = (
        adjust.adjust_bundle(replace(block, observed=(first, *others)))
        for first in (rays, rays.without(np.arange(len(rays)) < 5))
    )
    assert not _adjusted.spoils_others(without, beside, block.observed, [kind])
