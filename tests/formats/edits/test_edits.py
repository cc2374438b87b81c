"""Edits of a block: a file of them, what they do, and what they no longer fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CONTROL, NO_ROLE, Block
from aatri.artifacts.block_tables import Geodetic, GeodeticCovariances, GroundPointCovariances
from aatri.artifacts.solution import VarianceComponents
from aatri.artifacts.suspects import Suspects
from aatri.errors import AatriError
from aatri.formats.edits.edit import Edit, read_edits, write_edits
from aatri.formats.edits.edited import measured_value, with_edits
from aatri.formats.edits.proposals import proposals
from aatri.tables.digest import content_digest
from tests.stages.chain import simulated


@pytest.fixture(scope="module")
def block() -> Block:
    return simulated(
        5,
        preset="uav",
        flight={"strips": 2, "images_per_strip": 4},
        known={"full": 4},
        ties={"random_per_image": 60.0},
        gnss={"observed": True},
    )


def _names(block: Block, row: int) -> dict[str, str]:
    m = block.image_points
    return {"image": str(block.images.id[m.image[row]]), "point": str(block.points.id[m.point[row]])}


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    edits = (
        Edit("switch_off", "image_point", {"image": "1", "point": "P 1, \u4e00: {"}, value=(1.25, -1e-7), reason='"2"'),
        Edit("switch_off", "control", {"point": "007"}, coordinates="XZ"),
        Edit("renumber", "image_point", {"image": "0101", "point": "1", "to": "2"}),
        Edit("exchange", "control", {"point": "no", "to": "null"}),
        Edit("reweight", "distance", {"group": "edm"}, factor=1.5),
    )
    write_edits(tmp_path / "edits.yaml", edits)
    read = read_edits(tmp_path / "edits.yaml")
    assert [replace(edit, where="") for edit in read] == list(edits)
    assert all(edit.where.startswith(f"{tmp_path / 'edits.yaml'}:") for edit in read)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("edits: 3", "no list of edits"),
        ("edits: []\nmore: 1", "no list of edits"),
        ("edits: [x]", "edits.yaml:1:9: is no edit"),
        ("edits: [{do: delete, kind: control, point: A}]", "one of switch_off"),
        ("edits: [{kind: control, point: A}]", "the edit lacks `do`, its action; write one of switch_off"),
        (
            "edits:" + 2 * "\n- {do: exchange, kind: control, point: A, to: B}",
            "edits.yaml:3:3: exchange control point A to B: is written twice (first: ",
        ),
        ("edits: [{do: renumber, kind: control, point: A, to: B}]", "renumber of control; it takes image_point"),
        ("edits: [{do: switch_off, kind: image_point, image: A}]", "lacks point"),
        ("edits: [{do: switch_off, kind: control, piont: A, point: B}]", "did you mean 'point'"),
        ("edits: [{do: switch_off, kind: control, point: A, coordinates: W}]", "coordinates are W"),
        ("edits: [{do: reweight, kind: control}]", "lacks factor"),
        ("edits: [{do: reweight, kind: control, factor: -2}]", "not positive"),
        ("edits: [{do: reweight, kind: control, factor: yes}]", "no number"),
        ("edits: [{do: switch_off, kind: image_point, image: A, point: B, value: [1, .nan]}]", "no number"),
        ("edits: [{do: switch_off, kind: position, image: &a A}]", "anchor"),
        (
            "edits: [{do: switch_off, kind: attitude, image: A, coordinates: Z}]",
            "switch_off of attitude takes no",
        ),
        ("edits: [{do: switch_off, kind: control, point: A, factor: 2}]", "switch_off of control takes no factor"),
        ("edits: [{do: switch_off, kind: control, point: A, to: B}]", "switch_off of control takes no to"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "edits.yaml"
    path.write_text(text)
    with pytest.raises(AatriError) as error:
        read_edits(path)
    assert says in str(error.value).replace(": fix", ";").replace("\n    fix: ", "; ")


def test_an_exchange_done_twice_is_none(block) -> None:
    ground = block.ground_points
    control = block.points.id[ground.point[(ground.role == CONTROL).all(axis=1)]].tolist()
    m = block.image_points
    points = block.points.id[m.point[m.image == 0]].tolist()
    for edit in (
        Edit("exchange", "control", {"point": control[0], "to": control[1]}),
        Edit("exchange", "image_point", {"image": str(block.images.id[0]), "point": points[0], "to": points[1]}),
        Edit("exchange", "position", {"image": str(block.images.id[0]), "to": str(block.images.id[3])}),
    ):
        once = with_edits(block, (edit,))
        assert content_digest(once) != content_digest(block)
        assert content_digest(with_edits(once, (edit,))) == content_digest(block)


def test_what_is_switched_off_has_no_part_and_stands_among_the_rejects(block) -> None:
    first = str(block.points.id[block.ground_points.point[0]])
    role = int(block.ground_points.role[0, 0])
    image = str(block.images.id[2])
    edits = (
        Edit("switch_off", "image_point", _names(block, 7), reason="blunder"),
        Edit("switch_off", "control", {"point": first}, coordinates="Z"),
        Edit("switch_off", "position", {"image": image}, coordinates="XY"),
    )
    off = with_edits(block, edits)
    assert not off.image_points.active[7]
    assert (off.image_points.active.sum(), block.image_points.active.sum()) == (
        len(off.image_points) - 1,
        len(off.image_points),
    )
    row = int(np.flatnonzero(off.ground_points.point == block.ground_points.point[0])[0])
    assert off.ground_points.role[row].tolist() == [role, role, 0]
    (of_image,) = np.flatnonzero(off.exterior.image == 2)
    assert np.isfinite(off.exterior.position_m[of_image]).tolist() == [False, False, True]
    assert off.rejects.kind.tolist()[-3:] == ["image_point", "control", "position"]
    rows = np.append(np.arange(len(block.image_points)), 7)
    twice = with_edits(replace(block, image_points=block.image_points.take(rows)), edits[:1])
    assert twice.rejects.reason[-1] == "switched off by an edit, all 2 that are called so: blunder"


def test_a_number_and_a_weight_are_changed(block) -> None:
    names, m = _names(block, 3), block.image_points
    unseen = str(np.setdiff1d(block.points.id, block.points.id[m.point[m.image == m.image[3]]])[0])
    edits = (
        Edit("renumber", "image_point", {**names, "to": unseen}, value=measured_value(block, "image_point", 3)),
        Edit("reweight", "image_point", {"image": names["image"]}, factor=2.0),
        Edit("reweight", "control", {}, factor=3.0),
        Edit("reweight", "position", {}, "Z", factor=2.0),
    )
    changed = with_edits(block, edits)
    t = changed.image_points
    (row,) = np.flatnonzero((t.image == m.image[3]) & (changed.points.id[t.point] == unseen))
    assert t.xy[row].tolist() == m.xy[3].tolist()
    assert (np.diff(t.image.astype(np.int64) * len(block.points) + t.point) > 0).all()  # in canonical order
    np.testing.assert_allclose(t.sigma_mm[t.image == m.image[3]], 2 * m.sigma_mm[m.image == m.image[3]])
    np.testing.assert_allclose(changed.ground_points.covariance_m2, 9 * block.ground_points.covariance_m2)
    was, now = block.exterior.position_covariance_m2, changed.exterior.position_covariance_m2
    np.testing.assert_allclose(now, was * np.outer([1, 1, 2], [1, 1, 2]))


def _correlated(block: Block) -> Block:
    """The block whose first two points of the ground have correlated heights, and two correlated distances."""

    pair = GroundPointCovariances.of(row_a=[0], axis_a=[2], row_b=[1], axis_b=[2], value=[1e-5])
    distances = Geodetic.of(
        type=["distance"] * 2, start=["A", "B"], end=["B", "A"], value=[5.0, 5.0], sigma=[0.01, 0.01], group=["edm"] * 2
    )
    between = GeodeticCovariances.of(row_a=[0], row_b=[1], value=[4e-5])
    return replace(block, ground_point_covariances=pair, geodetic=distances, geodetic_covariances=between)


def test_correlations_stay_when_a_weight_is_changed(block) -> None:
    first = str(block.points.id[block.ground_points.point[0]])
    edits = (
        Edit("reweight", "control", {"point": first}, factor=3.0),
        Edit("reweight", "distance", {"from": "A"}, factor=2.0),
    )
    changed = with_edits(_correlated(block), edits)
    assert changed.ground_point_covariances.value == pytest.approx(3e-5)
    assert changed.geodetic_covariances.value == pytest.approx(8e-5)
    assert changed.geodetic.sigma.tolist() == [0.02, 0.01]


def test_what_an_edit_cannot_change_is_refused(block) -> None:
    first, second = (str(block.points.id[p]) for p in block.ground_points.point[:2])
    ground = block.ground_points
    exact = replace(block, ground_points=replace(ground, covariance_m2=0 * ground.covariance_m2))
    with pytest.raises(AatriError, match="0 or not stated"):
        with_edits(exact, (Edit("reweight", "control", {}, factor=2.0),))
    with pytest.raises(AatriError, match="correlated with other points"):
        with_edits(_correlated(block), (Edit("exchange", "control", {"point": first, "to": second}),))


def test_nothing_is_exchanged_with_itself(block) -> None:
    names = _names(block, 7)
    image, point = names["image"], str(block.points.id[block.ground_points.point[0]])
    for edit in (
        Edit("exchange", "control", {"point": point, "to": point}),
        Edit("exchange", "image_point", {**names, "to": names["point"]}),
        Edit("exchange", "position", {"image": image, "to": image}),
    ):
        with pytest.raises(AatriError, match="cannot be exchanged with itself"):
            with_edits(block, (edit,))


def test_exchanged_control_takes_its_roles_along(block) -> None:
    """As if the ids of two rows of ground_points.csv were exchanged: no coordinate is control without a value."""
    g = block.ground_points
    first, second = (str(block.points.id[p]) for p in g.point[:2])
    xyz_m, role = g.xyz_m.copy(), g.role.copy()
    role[:2] = [[CONTROL] * 3, [CONTROL, CONTROL, NO_ROLE]]
    xyz_m[1, 2] = np.nan
    mixed = replace(block, ground_points=replace(g, xyz_m=xyz_m, role=role))
    after = with_edits(mixed, (Edit("exchange", "control", {"point": first, "to": second}),)).ground_points
    np.testing.assert_array_equal(after.xyz_m[:2], xyz_m[[1, 0]])
    np.testing.assert_array_equal(after.role[:2], role[[1, 0]])
    np.testing.assert_array_equal(np.isnan(after.xyz_m), after.role == NO_ROLE)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"ids": {"image": "9999", "point": "1"}}, "no image_point has image 9999"),
        ({"value": (1.0, 2.0)}, "no such observation with the value [1.0, 2.0]"),
        ({"do": "renumber", "to": "nowhere"}, "the block has no point nowhere"),
        ({"do": "renumber", "to": "same"}, "the image has that point already"),
        ({"do": "exchange", "to": "nowhere"}, "no image_point has point nowhere"),
    ],
)
def test_an_edit_that_no_longer_fits_is_refused_by_name(block, change, says) -> None:
    names, m = _names(block, 7), block.image_points
    to = change.get("to", "")
    to = str(block.points.id[m.point[8]]) if to == "same" else to
    assert m.image[7] == m.image[8]
    ids = change.get("ids", names) | ({"to": to} if to else {})
    edit = Edit(
        change.get("do", "switch_off"), "image_point", ids, value=change.get("value", ()), where="edits.yaml:4:5"
    )
    with pytest.raises(AatriError, match=r"edits.yaml:4:5") as error:
        with_edits(block, (edit,))
    assert says in str(error.value)


def test_weights_that_no_edit_changes_are_named(block) -> None:
    groups = ("image_point", "control height", "position group f 1", "image_point camera A", "planes")
    n = len(groups)
    components = VarianceComponents.of(
        group=groups,
        observations=[99] * n,
        redundancy=[50.0] * n,
        factor=[2.0] * n,
        low=[1.5] * n,
        high=[2.5] * n,
        verdict=["proposed"] * n,
    )
    solution: Any = SimpleNamespace(proposed_numbers=None, suspects=Suspects.empty(), variance_components=components)
    made, others = proposals(block, solution, "bundle")
    assert [str(edit) for edit in made] == [
        "reweight image_point x 2",
        "reweight control Z x 2",
        "reweight position group f 1 x 2",
    ]
    assert [other.split(" (")[0] for other in others] == [
        "standard deviation of image_point camera A",
        "standard deviation of planes",
    ]
    assert with_edits(block, made[:2]) is not block
