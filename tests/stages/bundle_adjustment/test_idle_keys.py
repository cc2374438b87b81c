"""Keys and options that can have no effect are told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.pipeline.plan.unused import unused
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle, bundle_uses
from aatri.stages.bundle_adjustment.intersection import IntersectionOptions, intersection
from aatri.stages.image_refinement.systematic import SystematicOptions
from aatri.stages.image_refinement.systematic import systematic as refinement
from aatri.stages.relative_orientation.dependent import dependent
from tests.stages.bundle_adjustment.test_given_in_part import cells, exterior
from tests.stages.hand_block import Hand, Heard, ground_rows, hand, read, start


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


@pytest.mark.parametrize(
    ("stage", "options"),
    [
        (bundle, BundleOptions(positions={"drift": "shift"})),
        (bundle, BundleOptions(attitudes={"drift": "shift"})),
        (bundle, BundleOptions(rigs={"position_m": 0.1})),
        (bundle, BundleOptions(rigs={"use": True})),
        (bundle, BundleOptions(distances={"scale": False})),
        (bundle, BundleOptions(readout_sigma=0.05)),
        (bundle, BundleOptions(velocity_sigma=None)),
        (intersection, IntersectionOptions(positions={"drift": "none"})),
    ],
)
def test_options_of_a_kind_that_is_not_there_are_told(of: Hand, stage: Any, options: Any, tmp_path: Path) -> None:
    block, points = read(tmp_path, of, ground=ground_rows(of, [0, 5, 24, 29]))
    heard = Heard()
    stage(block, points, start(of, block), options=options, context=heard)
    (name,) = options.model_fields_set
    assert any(text.startswith(f"{name}: options are set") for text in heard.warned)
    assert not any("options are set" in text for text in _plain(of, block, points))


def _plain(of: Hand, block: Any, points: Any) -> list[str]:
    heard = Heard()
    bundle(block, points, start(of, block), context=heard)  # type: ignore[arg-type]
    return heard.warned


@pytest.mark.parametrize(
    ("times", "word"),
    [([5.0] * 6, "one time"), ([0, 10, 20, 0, 20, 10], "do not run"), ([0, 10, 20, 50, 60, 70], ""), ([""] * 6, "")],
)
def test_times_that_are_equal_or_permuted_under_drift_are_told(
    of: Hand, times: list[Any], word: str, tmp_path: Path
) -> None:
    rows = [cells(of, k) | dict.fromkeys(("sX", "sY", "sZ"), 0.1) | {"drift_group": "g"} for k in range(6)]
    images = [f"i{k},c,s{k // 3},{k % 3},{times[k]}" for k in range(6)]
    _, points = read(tmp_path, of, ground=ground_rows(of, [0, 5, 24, 29]), exterior=exterior(rows))
    (tmp_path / "images.csv").write_text("\n".join(["image,camera,strip,sequence,time", *images]) + "\n")
    block = tables(options=TablesOptions(path=tmp_path))
    heard = Heard()
    bundle(block, points, start(of, block), options=BundleOptions(blunders="none"), context=heard)  # type: ignore[arg-type]
    told = [text for text in heard.warned if "drift group" in text]
    assert len(told) == bool(word)
    assert all(word in text and "g" in text for text in told)


@pytest.mark.parametrize("method", ["robust_snooping", "none", "robust"])
def test_flights_are_used_where_groups_are_tested(method: str) -> None:
    uses = bundle_uses(BundleOptions.model_validate({"blunders": method}))
    assert ("images.flight:observed" in uses) == (method != "robust")
    assert "images.flight" not in uses  # of image points no group is tested by flights


@pytest.mark.parametrize("timed", [False, True])
def test_flights_of_images_with_row_times_are_not_idle(of: Hand, timed: bool, tmp_path: Path) -> None:
    """Their velocity is that of their flight."""
    block, _ = read(tmp_path, of, ground=ground_rows(of, [0, 5, 24, 29]))
    images = replace(block.images, flight=np.full(len(block.images), "f"))
    row_time_s = np.full(len(block.image_points), 0.01 if timed else np.nan)
    block = replace(block, images=images, image_points=replace(block.image_points, row_time_s=row_time_s))
    offered = {offer.name for offer in block.offers()}
    assert ("images.flight" in offered, "images.flight:observed" in offered) == (not timed, timed)


def test_undulation_and_terrain_height_without_effect_are_offered_as_such(of: Hand, tmp_path: Path) -> None:
    frames = {"map": {"axes": ["east", "north", "up"], "crs": "EPSG:32650"}}
    more = {"undulation": 12.0, "terrain_height": 6.0, "frames": frames, "earth_curvature": "correct"}
    block, _ = read(tmp_path, of, ground=ground_rows(of, [0, 5]), more=more)
    offers = {o.name: o for o in block.offers()}
    assert offers["undulation:without_effect"].nature == "reduction"
    assert offers["terrain_height"].bears_on == "ImagePoints"
    assert "undulation" not in offers


def test_a_lens_that_is_known_rejects_no_good_point_of_a_relative_orientation(of: Hand, tmp_path: Path) -> None:
    """500 um of distortion at the edge: the models are those of corrected points, and the stage says so."""
    lens = {"distortion": {"model": "brown", "k1": -3e-7}}
    seen = of.xy_mm
    for _ in range(50):
        seen = of.xy_mm / (1 - 3e-7 * (seen**2).sum(axis=1, keepdims=True))
    assert np.abs(seen - of.xy_mm).max() > 0.3
    block, points = read(tmp_path, of, ground=ground_rows(of, [0, 5]), xy_mm=seen, camera=lens)
    heard = Heard()
    models = dependent(block, points, context=heard)  # type: ignore[arg-type]
    assert len(models.suspects) == 0
    assert any("distortion of the lens" in text for text in heard.logged)
    again = dependent(block, refinement(block, points, options=SystematicOptions(refraction=False)))
    np.testing.assert_allclose(models.orientations.left_from_right, again.orientations.left_from_right, atol=1e-12)


def test_ignore_of_nothing_is_told() -> None:
    def node(name: str, inputs: dict[str, str], kind: str) -> Any:
        method = SimpleNamespace(kind=kind, name=name)
        return SimpleNamespace(name=name, inputs=inputs, uses=("images.strip",), needs=(), method=method)

    nodes = (node("block", {}, "Block"), node("bundle", {"block": "block"}, "Solution"))
    record = {"stage": "block", "offers": [], "output": {"kind": "Block"}}
    found = unused(nodes, [record], ("exterior.angels_rad",))
    assert any("ignore: exterior.angels_rad" in text for _, text in found.warnings)
