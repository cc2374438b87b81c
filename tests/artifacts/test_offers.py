"""What a Block offers: every given value that is to have an effect, by name, with count and place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import TRUTH, Block
from aatri.artifacts.needed_datum import SIMILARITY, WITHOUT_SHIFT
from aatri.artifacts.offers import offers_of
from aatri.pipeline.methods.registry import find_stages
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle_needs
from aatri.tables.schema import columns_of, tables_of
from tests.formats.tables.block_folder import replaced, write_folder
from tests.reading import read_block
from tests.stages.chain import simulated
from tests.stages.hand_block import ground_rows, hand, read

READ_BY_EVERY_STAGE = {
    "files": {"path"},
    "frames": {"id", "axes", "crs", "vertical"},
    "cameras": {
        "id",
        "kind",
        "image_coordinates",
        "pixel_size_mm",
        "pixel_origin",
        "pixel_y",
        "format",
        "principal_distance_mm",
        "principal_point_mm",
        "symmetry_point_mm",
    },
    "camera_parameters": {"camera", "name", "value"},
    "distortion_table": {"camera", "radius_mm", "correction_mm"},
    "fiducials": {"camera", "id", "xy_mm"},
    "rig_members": {
        "rig",
        "member",
        "is_frame",
        "position_m",
        "angles_rad",
        "position_sigma_m",
        "position_free",
        "angle_sigma_rad",
        "angle_free",
    },  # by images.rig
    "strips": {"id"},
    "images": {"path", "mask", "content", "id", "camera", "sequence", "time_s", "member", "active"},
    "fiducial_points": {"image", "fiducial", "sigma_mm"},
    "points": {"id"},
    "image_points": {"image", "point", "sigma_mm", "active"},
    "ground_points": {"point", "role"},
    "ground_point_covariances": {"row_a", "axis_a", "row_b", "axis_b", "value"},  # the whole table
    "exterior": {"image", "position_covariance_m2", "angle_sigma_rad", "position_use", "angle_use", "refers_to"},
    "model_coordinates": {"model", "point", "sigma", "centre"},
    "geodetic": {
        "type",
        "start",
        "end",
        "via",
        "start_kind",
        "end_kind",
        "value",
        "sigma",
        "set",
        "active",
        "start_height_m",
        "end_height_m",
    },  # by type, and heights
    "geodetic_covariances": {"row_a", "row_b", "value"},
    "relative_control": {"type", "value", "sigma", "axis"},
    "relative_control_members": {"condition", "part", "id"},
    "rejects": {"kind", "id", "reason"},
}
"""Columns that come with another that is offered, identify, or are read whenever there is anything to read."""

WEIGHTED = {"camera_parameters": {"sigma", "free"}}
"""Offered by the name of the parameter."""


def _offers(block: Block) -> dict[str, tuple[str, str]]:
    return {offer.name: (offer.what, Path(offer.where).name) for offer in block.offers()}


def test_a_folder_with_a_bit_of_everything_offers_it_by_name_with_count_and_place(tmp_path: Path) -> None:
    offers = _offers(read_block(write_folder(tmp_path / "block")))
    assert offers["exterior.angles_rad"] == ("2 observed attitudes (exterior.csv: a1, a2, a3)", "exterior.csv:4")
    assert offers["exterior.drift_group"][0].startswith("drift groups of 1 observed position (")
    assert offers["cameras.lever_arm_m:without_antenna"][1] == "camera uav"
    assert offers["cameras.boresight_rad"][1] == "camera uav"
    assert offers["geodetic:distance"] == (
        "1 observation of type distance (geodetic.csv: value, sigma)",
        "geodetic.csv:2",
    )
    assert offers["geodetic:height_difference_to_image"][1] == "geodetic.csv:7"
    assert {"geodetic:angle", "geodetic:direction", "geodetic:dX", "geodetic:dY"} < set(offers)
    assert {"geodetic.heights", "geodetic.reduced:distance", "geodetic_covariances"} < set(offers)
    assert {
        f"relative_control:{t}"
        for t in ("vertical_plane", "distance", "coordinate_difference", "angle", "parallel", "sphere")
    } < set(offers)
    assert offers["image_points.group"][1] == "image_points.csv:4"
    assert {"camera_parameters:brown.k1", "camera_parameters:brown.principal_distance"} < set(offers)
    assert "camera_parameters:brown.k2" not in offers  # sigma 0: fixed
    assert {"images.session", "earth_curvature:correct", "cameras.distortion"} < set(offers)


@pytest.mark.parametrize(
    ("file", "old", "new", "name"),
    [
        ("block.yaml", "earth_curvature: correct", "earth_curvature: frame", "earth_curvature:frame"),
        (
            "exterior.csv",
            ",,,,,,,,antenna,g1",
            ",,,,,,,approximate,antenna,g1",
            "exterior.drift_group:without_positions",
        ),
        (
            "exterior.csv",
            "d2,4505179.5,446463.9,385.2,,,,1,2,3,,,,observed,,",
            "d2,4505179.5,446463.9,385.2,,,,1,2,3,,,,observed,antenna,",
            "cameras.lever_arm_m",
        ),
        ("block.yaml", "terrain_height: 6.1", "terrain_height: 6.1\nundulation: 12.3", "undulation:without_effect"),
    ],
)
def test_what_is_given_otherwise_has_a_name_of_its_own(
    tmp_path: Path, file: str, old: str, new: str, name: str
) -> None:
    plain = set(_offers(read_block(write_folder(tmp_path / "plain"))))
    changed = set(_offers(read_block(write_folder(tmp_path / "changed", replaced(file, old, new)))))
    assert name in changed - plain


def test_every_column_of_a_block_is_offered_or_known_to_be_read() -> None:
    offered = {name.partition(":")[0] for name in Block.offered_names()}
    for table, cls in tables_of(Block).items():
        if table in TRUTH:
            continue
        columns = set(columns_of(cls)) - {"file", "line"} - WEIGHTED.get(table, set())
        missing = (
            columns
            - READ_BY_EVERY_STAGE.get(table, set())
            - {n.partition(".")[2] for n in offered if n.startswith(f"{table}.")}
        )
        assert not missing, f"{table}: {missing}"


def test_the_stages_of_the_demo_use_all_that_the_demo_offers() -> None:
    flight = {"strips": 1, "images_per_strip": 3, "cross_strips": 0}
    offers = _offers(simulated(preset="rc30", flight=flight, ties={"new_points": 60}))
    registry, used = find_stages(), set()
    for name in (
        "interior_orientation/affine",
        "image_refinement/systematic",
        "relative_orientation/dependent",
        "absolute_orientation/similarity",
        "bundle_adjustment/bundle",
        "accuracy/evaluation",
    ):
        card = registry.card(name)
        used |= set(card.used_with(card.options() if card.options else None) or ())
    assert set(offers) - {WITHOUT_SHIFT, SIMILARITY} <= used


def test_every_built_in_stage_says_what_it_uses() -> None:
    registry = find_stages()
    silent = [name for name in registry.variants if registry.card(name).uses is None]
    assert silent == []


def test_positions_in_no_drift_group_say_where_a_block_lies_and_are_not_told_as_unused() -> None:
    block = simulated(1, gnss={"observed": True, "shift_m": 2.0}, known={"full": 0})
    assert "exterior.position_m" in _offers(block)
    assert WITHOUT_SHIFT not in _offers(block)
    without = replace(block, exterior=replace(block.exterior, drift_group=np.full(len(block.exterior), "")))
    (offer,) = (o for o in offers_of(without) if o.name == WITHOUT_SHIFT)
    assert offer.bears_on == ""
    for given, positions, found in (
        (block, {}, False),
        (block, {"drift": "none"}, True),
        (without, {}, True),
        (without, {"per": "block"}, False),
    ):
        need, _ = bundle_needs(BundleOptions.model_validate({"positions": positions}))
        assert bool(set(need.one_of) & {o.name for o in offers_of(given)}) == found


def test_datum_marks_are_for_an_initial_orientation_where_coordinates_do_not_place_the_block(tmp_path: Path) -> None:
    """With three points known in full and not on one line they are for a bundle over marked points alone."""
    far = (5e5, 5.4e6, 300.0)
    for case, (relief_m, known, name) in enumerate(
        (
            (50.0, [1, 2], "ground_points.datum"),
            (50.0, [1, 2, 3], "ground_points.datum:placed"),
            (0.0, [1, 2, 3, 4], "ground_points.datum"),  # on one line, about which the block turns
            (0.0, [1, 2, 9], "ground_points.datum:placed"),
        )
    ):
        of = hand(far, relief_m)
        ground = ground_rows(of, known, tail=",control,no", head=",role,datum") + "p19,1.0,2.0,3.0,approximate,yes\n"
        block, _ = read(tmp_path / str(case), of, ground=ground)
        assert {n for n in _offers(block) if n.startswith("ground_points.datum")} == {name}
    registry = find_stages()
    begin = registry.card("initial_orientation/graph").used_with(None)
    free = registry.card("bundle_adjustment/bundle").used_with(BundleOptions(datum="free", datum_over="marked"))
    assert "ground_points.datum" in (begin or ())
    assert {"ground_points.datum", "ground_points.datum:placed"} <= set(free or ())
