"""Strips that hold too little control each, and are determined by what they share and control together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.adapters.frame.adjustment_frame import InTangentFrame, geodesy_of, in_tangent_frame, poses_into
from aatri.artifacts.block import Block
from aatri.errors import GeometryError
from aatri.geometry import known_rotations
from aatri.geometry.rotations import log_rotation
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import rays_of
from aatri.observations.poses import Poses
from aatri.orientation.bodies.by_attitudes import images_by_attitudes
from aatri.orientation.bodies.ground_observed import GroundObserved, ground_observed
from aatri.orientation.graph.to_ground import _look_down
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.small_blocks import Small, adjusted_by, flown, off_m
from tests.stages.bundle_adjustment.test_attitudes import flown as surveyed


def sharing(points: int, *, control: dict[str, str], attitudes: bool = False) -> Small:
    """Two strips of four images with so many points in common, none of which is control."""
    small = flown(2, 4, points=40)
    strips = {p: {small.strip[i][0] for i, q in small.rays if q == p} for p in small.xyz_m}
    often = {p: sum(q == p for _, q in small.rays) for p in small.xyz_m}
    both = [p for p in small.xyz_m if strips[p] == {"S1", "S2"} and p not in control and often[p] > 5]
    ends = [min(both, key=lambda p: small.xyz_m[p] @ [a, b, 0]) for a, b in ((1, 1), (-1, 1), (0, -1))]
    kept = ends[:points]
    small.rays = {
        (i, p): xy
        for (i, p), xy in small.rays.items()
        if len(strips[p]) == 1 or p in kept or small.strip[i][0] == ("S2" if small.xyz_m[p][1] > 225.0 else "S1")
    }
    small.control, small.observed = control, {}
    small.attitudes = [*small.strip] if attitudes else []
    return small


TOGETHER = [
    pytest.param({"control": {"C1": "XYZ", "C3": "XYZ", "C2": "XYZ"}}, 3, id="three points, of which a strip has one"),
    pytest.param({"control": {"C1": "XYZ", "C4": "XYZ"}, "attitudes": True}, 1, id="a point in each, and attitudes"),
]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("chain", ["graph", "chain"])
@pytest.mark.parametrize(("given", "points"), TOGETHER)
def test_strips_that_only_together_are_determined_are_oriented(
    tmp_path: Path, chain: str, given: dict[str, object], points: int
) -> None:
    small = sharing(points, **given)  # type: ignore[arg-type]
    done = adjusted_by(chain, small.write(tmp_path / "b"))
    assert done.bundle.images.oriented.all()
    assert off_m(small, done.initial) < 15.0
    assert off_m(small, done.bundle) < 1.5
    assert done.bundle.sigma0 < 1.3


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("chain", ["graph", "chain"])
def test_strips_that_together_are_open_too_are_refused(tmp_path: Path, chain: str) -> None:
    small = sharing(3, control={"C1": "XYZ", "C2": "XYZ"})
    with pytest.raises(GeometryError, match="not determined"):
        adjusted_by(chain, small.write(tmp_path / "b"))


@pytest.mark.slow
def test_a_strip_beside_one_that_is_oriented_is_called_so_with_what_takes_part(tmp_path: Path) -> None:
    """Three control points in one strip; in the other one, a point in common and attitudes."""
    small = sharing(1, control={"C1": "XYZ", "C3": "XYZ", "C2": "XYZ"}, attitudes=True)
    in_first = {p for i, p in small.rays if small.strip[i][0] == "S1"} - {p for i, p in small.rays if i[0] == "2"}
    small.control[max(in_first - {*small.control}, key=lambda p: small.xyz_m[p] @ [0.0, 1.0, 0.0])] = "XYZ"
    done = adjusted_by("chain", small.write(tmp_path / "b"))
    assert done.initial.images.oriented.all()
    (line,) = [text for text in done.lines if "oriented by what it shares with others that are oriented" in text]
    assert line.startswith("component 2 (strip S2): ")
    assert [text for text in done.lines if text.startswith("component 2 (strip S2): attitudes of 4 images take part")]
    assert not [text for text in done.lines if "together with others" in text]


@pytest.mark.parametrize(("elevation_deg", "level"), [(-90.0, True), (-60.0, True), (0.0, False)])
def test_components_begin_level_only_beside_images_that_look_down(elevation_deg: float, level: bool) -> None:
    """A facade that is begun level lies on its back."""
    rotation = Rotation.from_euler("x", np.full((4, 1), 90.0 + elevation_deg), degrees=True).as_matrix()
    component = SimpleNamespace(poses=Poses(np.zeros((4, 3)), rotation), images=np.arange(4) > 0)
    assert _look_down(cast(Any, [SimpleNamespace(component=component)])) == level
    assert _look_down([])


def surveyed_inside(block: Block) -> tuple[InTangentFrame, GroundObserved, ImagePointRows]:
    inside = in_tangent_frame(block)
    ground = ground_observed(block, inside.block, inside.frame, geodesy_of(block, inside.frame), use_positions=True)
    return inside, ground, rays_of(inside.block, calibrated(block))


@pytest.mark.parametrize("system", ["omega-phi-kappa", "roll-pitch-heading"])
@pytest.mark.parametrize("positions", [0, 5])
def test_attitudes_place_images_where_grid_north_is_not_true_north(system: str, positions: int) -> None:
    """200 km beside the central meridian, 1.5 degrees; attitudes are exact but for a boresight of 1 degree."""
    block = surveyed(1, {"false_origin_m": (700_000.0, 4_505_000.0)}, rotation=system)
    e, truth = block.exterior, block.true_images
    lacks = np.isin(e.image, range(positions, 10))[:, None]
    exact = replace(e, position_m=np.where(lacks, np.nan, e.position_m), angle_sigma_rad=0 * e.angle_sigma_rad)
    block = replace(block, exterior=exact)
    inside, ground, rays = surveyed_inside(block)
    body = images_by_attitudes(ground, rays, [])
    assert truth is not None
    assert not isinstance(body, str)
    true = poses_into(inside.frame, truth.position_m, truth.ground_from_image)
    turn = log_rotation(body.poses.ground_from_image @ true.ground_from_image.swapaxes(1, 2))
    assert np.abs(turn).max() < 1e-3
    assert np.abs(body.poses.position_m + ground.origin_m - true.position_m).max() < 1.0
    assert body.turn_rad > 0


def test_attitudes_place_only_images_that_are_not_on_the_ground(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, ground, rays = surveyed_inside(surveyed(1))
    body = images_by_attitudes(ground, rays, [])
    assert not isinstance(body, str)
    begun = replace(body, poses=body.poses.where(np.arange(10) < 7))
    others = images_by_attitudes(ground, rays, [begun])
    assert not isinstance(others, str)
    assert (others.poses.oriented == (np.arange(10) >= 7)).all()
    assert np.allclose(others.poses.position_m[7:], body.poses.position_m[7:], atol=0.5)
    monkeypatch.setattr(known_rotations, "MOST_CENTRES", 3)
    reason = images_by_attitudes(ground, rays, [begun])
    assert isinstance(reason, str)
    assert "do not place 3 images" in reason


@pytest.mark.parametrize("chain", ["graph", "chain"])
def test_an_image_without_an_attitude_stands_beside_those_that_attitudes_place(tmp_path: Path, chain: str) -> None:
    """A single ray shows the second control point of a strip: attitudes tell its scale."""
    small = flown(1, 4, points=40)
    once = next(i for i, p in small.rays if p == "C2")
    small.rays = {(i, p): xy for (i, p), xy in small.rays.items() if p != "C2" or i == once}
    small.control, small.observed, small.attitudes = {"C1": "XYZ", "C2": "XYZ"}, {}, [*small.strip][:3]
    done = adjusted_by(chain, small.write(tmp_path / "b"))
    assert done.initial.images.oriented.all()
    assert off_m(small, done.initial) < 5.0
    assert [text for text in done.lines if text.startswith("3 images are placed by attitudes")]
    assert not [text for text in done.lines if "stays apart" in text or "begun level" in text]
