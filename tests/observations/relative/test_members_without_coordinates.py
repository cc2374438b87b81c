"""Members of relative control that have no coordinates are left out by name, whatever the condition."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.hand_block import Hand, Heard, ground_rows, hand, read, start

FEWEST = {
    "plane": 4,
    "vertical_plane": 3,
    "line": 3,
    "plumb_line": 2,
    "horizontal_line": 2,
    "horizontal_plane": 2,
    "equal_height": 2,
    "sphere": 5,
    "cylinder": 6,
}
"""Members that give some redundancy."""

LOST = (23, 28, 29)
MEMBERS = (1, 8, 15, 22, 9, 26, 13)


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


def adjusted(folder: Path, of: Hand, conditions: list[dict[str, Any]]) -> tuple[Solution, list[str]]:
    folder.mkdir(parents=True)
    (folder / "relative_control.yaml").write_text(yaml.safe_dump(conditions))
    block, points = read(folder, of, ground=ground_rows(of, [0, 5, 24, 14]))
    m = points.measurements
    points = replace(points, measurements=replace(m, active=m.active & ~np.isin(m.point, LOST)))
    xyz = np.where(np.isin(np.arange(30), LOST)[:, None], np.nan, of.xyz_m)
    heard = Heard()
    options = BundleOptions(blunders="none", max_sigma0=1e6)
    return bundle(block, points, start(of, block, xyz_m=xyz), options=options, context=heard), heard.warned  # type: ignore[arg-type]


def condition(type_: str, members: Any, **how: Any) -> dict[str, Any]:
    radius = {"radius": 400.0} if type_ == "cylinder" else {}
    return {"type": type_, "points": [f"p{k:02}" for k in members], **radius, **how}


@pytest.mark.parametrize(("type_", "how"), [*((t, {"sigma": 50.0}) for t in FEWEST), ("equal_height", {"exact": True})])
def test_a_member_without_coordinates_is_left_out_by_name(of: Hand, type_: str, how: Any, tmp_path: Path) -> None:
    members = MEMBERS[: FEWEST[type_]]
    found, warned = adjusted(tmp_path / "with", of, [condition(type_, [*members, LOST[0]], **how)])
    assert any(f"p{LOST[0]}" in text and type_ in text for text in warned)
    without, _ = adjusted(tmp_path / "without", of, [condition(type_, members, **how)])
    np.testing.assert_allclose(found.points.xyz_m, without.points.xyz_m, atol=1e-4)
    np.testing.assert_allclose(found.points.covariance_m2, without.points.covariance_m2, rtol=1e-4, atol=1e-12)
    assert found.redundancy == without.redundancy


@pytest.mark.parametrize("type_", ["plane", "vertical_plane", "line", "plumb_line", "horizontal_line", "equal_height"])
def test_a_shape_of_too_few_points_says_nothing_and_is_named(of: Hand, type_: str, tmp_path: Path) -> None:
    members = [*MEMBERS[: FEWEST[type_] - 2], *LOST]
    found, warned = adjusted(tmp_path / "with", of, [condition(type_, members, sigma=0.01)])
    plain, _ = adjusted(tmp_path / "plain", of, [])
    np.testing.assert_allclose(found.points.xyz_m, plain.points.xyz_m, atol=1e-6)
    assert any(f"p{k}" in text and type_ in text for k in LOST for text in warned)
