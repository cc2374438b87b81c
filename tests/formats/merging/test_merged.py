"""A block cut in two and merged is the block; what two blocks say otherwise is averaged or told by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.builder import block_of
from aatri.checks.as_read.screening import screened
from aatri.errors import AatriError, InputError
from aatri.formats.merging.merged import merged
from aatri.formats.merging.names import RenamingOptions, renamed
from aatri.formats.merging.part import part_of
from aatri.formats.tables.writer import write_block
from aatri.progress import SILENT, Reporter
from aatri.stages.block.merged import MergedOptions
from aatri.stages.block.merged import merged as merged_stage
from aatri.stages.block.part import PartOptions
from aatri.stages.block.part import part as part_stage
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.tables.digest import content_digest
from aatri.tables.hdf5 import write

BLOCKS: dict[str, dict[str, Any]] = {
    "film": {"flight": {"strips": 3, "images_per_strip": 4, "cross_strips": 1}},
    "survey": {
        "flight": {"strips": 3, "images_per_strip": 4},
        "camera": {"kind": "digital", "format": (20000, 14000), "distortion": "brown", "brown": {"k1": 1e-9}},
        "survey": {"distances": 6, "direction_sets": 2, "baselines": 4, "relative": {"distance": 3, "plane": 1}},
        "imu": {"observed": True},
    },
    "wrong": {
        "flight": {"strips": 3, "images_per_strip": 4},
        "gross_errors": {"image_points": 0.02, "control": 0.2},
    },
}


def simulated(name: str) -> Block:
    return simulate(options=SimulateOptions.model_validate(BLOCKS[name]), rng=np.random.default_rng(3))


def cut(block: Block, *strips: str) -> Block:
    return part_of(block, np.isin(block.images.strip, np.flatnonzero(np.isin(block.strips.id, strips))))


def joined(*blocks: Block, reporter: Reporter = SILENT, **options: Any) -> Block:
    names = [f"part {k + 1}" for k in range(len(blocks))]
    return merged(blocks, names, reporter, name=blocks[0].name, sigmas=6.0, **options)


def ray_block(points: dict[str, dict[str, Any]], control: dict[str, dict[str, Any]], **camera: Any) -> Block:
    """Image points by `image/point` with xy, control by id with xyz."""
    images = sorted({name.split("/")[0] for name in points})
    ground = [{"sigma_m": 0.02, "role": CONTROL, **of} for of in control.values()]
    return block_of(
        name="b",
        cameras={"id": ["c"], "principal_distance_mm": 100.0, "pixel_size_mm": [[0.01, 0.01]], **camera},
        images={"id": images, "camera": "c", "strip": "s"},
        image_points={
            "image": [name.split("/")[0] for name in points],
            "point": [name.split("/")[1] for name in points],
            "xy": np.array([of["xy"] for of in points.values()], dtype=float),
            "sigma_mm": np.array([[of.get("sigma_mm", 0.005)] * 2 for of in points.values()]),
        },
        ground_points={
            "point": list(control),
            "xyz_m": np.array([of["xyz_m"] for of in ground], dtype=float),
            "sigma_m": np.array([[of["sigma_m"]] * 3 for of in ground]),
            "role": np.array([[of["role"]] * 3 for of in ground]),
        },
    )


A: dict[str, dict[str, Any]] = {"1/P": {"xy": (1, 2)}, "1/Q": {"xy": (3, 4)}, "2/P": {"xy": (5, 6)}}
B: dict[str, dict[str, Any]] = {"2/P": {"xy": (5, 6)}, "2/Q": {"xy": (7, 8)}, "3/P": {"xy": (9, 9)}}
K: dict[str, dict[str, Any]] = {"P": {"xyz_m": (10, 20, 30)}}


class Heard:
    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.lines: list[str] = []

    def warn(self, text: str) -> None:
        self.warnings.append(text)

    def log(self, text: str) -> None:
        self.lines.append(text)

    def progress(self, *_: Any, **__: Any) -> None: ...


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_cut_in_two_and_merged_is_the_block(name: str) -> None:
    block = simulated(name)
    strips = block.strips.id.tolist()
    parts = [cut(block, *strips[:2]), cut(block, *strips[1:])]
    assert all(0 < len(part.images) < len(block.images) for part in parts)
    either = {str(name) for part in parts for name in part.points.id}
    whole = joined(*parts)
    if either == set(block.points.id.tolist()) and len(whole.geodetic) == len(block.geodetic):
        assert content_digest(whole) == content_digest(block)
    assert content_digest(joined(*parts[::-1])) == content_digest(whole)
    again = [cut(whole, *strips[:2]), cut(whole, *strips[1:])]
    assert [content_digest(part) for part in again] == [content_digest(part) for part in parts]


@pytest.mark.slow
def test_parts_by_the_stages_from_folders_and_artifacts_are_the_whole(tmp_path: Path) -> None:
    block = simulate(
        options=SimulateOptions.model_validate({"flight": {"strips": 2, "images_per_strip": 5}}),
        rng=np.random.default_rng(3),
    )
    write(block, tmp_path / "block.h5")
    west = part_stage(options=PartOptions(path=tmp_path / "block.h5", images=["*1", "*2", "*3"]))
    east = part_stage(options=PartOptions(path=tmp_path / "block.h5", images=["*3", "*4", "*5"]))
    assert isinstance(west, Block)
    assert isinstance(east, Block)
    west, east = screened(west), screened(east)  # as if each had been read alone
    assert not (west.image_points.active.all() and east.image_points.active.all())  # seen once in a part alone
    write(west, tmp_path / "west.h5")
    write_block(east, tmp_path / "east")
    options = MergedOptions(blocks=(tmp_path / "west.h5", tmp_path / "east"), name=block.name)
    whole = merged_stage(options=options)
    without = frozenset({"true_images", "true_points", "gross_errors", "frames"})
    assert content_digest(whole, without=without) == content_digest(block, without=without)


def test_equal_rows_count_once_and_two_measurements_are_averaged_by_their_weights() -> None:
    other = {**B, "2/P": {"xy": (5.5, 6), "sigma_mm": 0.01}}
    heard = Heard()
    block = joined(ray_block(A, K), ray_block(other, K), reporter=heard)
    assert len(block.image_points) == 5
    row = int(np.flatnonzero((block.image_points.image == 1) & (block.image_points.point == 0))[0])
    np.testing.assert_allclose(block.image_points.xy[row], [(5 * 4 + 5.5) / 5, 6])
    np.testing.assert_allclose(block.image_points.sigma_mm[row], 1 / np.sqrt(1 / 0.005**2 + 1 / 0.01**2))
    assert any("averaged" in line and "2/P" in line for line in heard.lines)
    with pytest.raises(AatriError, match=r"2/P measured in part 1 and in part 2.*`duplicates: refuse`"):
        joined(ray_block(A, K), ray_block(other, K), duplicates="refuse")
    first = joined(ray_block(A, K), ray_block(other, K), duplicates="first")
    np.testing.assert_allclose(first.image_points.xy[row], [5, 6])


def test_control_is_averaged_with_its_covariances() -> None:
    C, D = 4e-4 * np.eye(3), np.array([[1e-4, 5e-5, 0], [5e-5, 2e-4, 0], [0, 0, 3e-4]])
    a, b = ray_block(A, K), ray_block(B, {"P": {"xyz_m": (10.01, 19.98, 30.0)}})
    b = replace(b, ground_points=replace(b.ground_points, covariance_m2=D[None]))
    ground = joined(a, b).ground_points
    P, Q = np.linalg.inv(C), np.linalg.inv(D)
    expected = np.linalg.solve(P + Q, P @ [10, 20, 30] + Q @ [10.01, 19.98, 30.0])
    np.testing.assert_allclose(ground.xyz_m[0], expected, rtol=1e-13)
    np.testing.assert_allclose(ground.covariance_m2[0], np.linalg.inv(P + Q), rtol=1e-12, atol=1e-18)


def test_coordinates_given_in_one_block_each_are_put_together() -> None:
    a, b = ray_block(A, {"P": {"xyz_m": (10, 20, np.nan)}}), ray_block(B, {"P": {"xyz_m": (np.nan, np.nan, 30)}})
    ground = joined(a, b).ground_points
    assert ground.xyz_m.tolist() == [[10, 20, 30]]
    np.testing.assert_allclose(np.diagonal(ground.covariance_m2[0]), 4e-4)


def test_one_control_point_with_other_coordinates_is_named_with_both() -> None:
    a, b = ray_block(A, K), ray_block(B, {"P": {"xyz_m": (10.5, 20, 30)}})
    with pytest.raises(AatriError, match=r"ground point P: X: 10 in part 1, 10.5 in part 2: -0.5 apart, 17.7 standard"):
        joined(a, b)
    heard = Heard()
    taken = joined(a, b, conflicts="first", reporter=heard)
    assert taken.ground_points.xyz_m.tolist() == [[10, 20, 30]]
    assert "ground point P: X" in heard.warnings[0]


def test_exact_control_has_to_be_equal() -> None:
    a, b = (ray_block(r, {"P": {"xyz_m": (10, 20, z), "sigma_m": 0.0}}) for r, z in ((A, 30), (B, 30.001)))
    with pytest.raises(AatriError, match=r"ground point P: Z: 30 in part 1, 30.001 in part 2.*exact"):
        joined(a, b)


@pytest.mark.parametrize("role", [CONTROL, CHECK])
def test_another_datum_is_told_as_such(role: int) -> None:
    three = {name: {"xyz_m": (x, 20, 30)} for name, x in (("P", 10), ("Q", 60), ("R", 90))}
    three["R"]["role"] = role
    moved = {name: {**of, "xyz_m": np.add(of["xyz_m"], (3.0, -2.0, 0.5))} for name, of in three.items()}
    with pytest.raises(AatriError, match=r"all 3 common control and check points .* lie \(3.000, -2.000, 0.500\) m"):
        joined(ray_block(A, three), ray_block(B, moved))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"principal_distance_mm": 101.0}, r"camera c: principal_distance_mm: 100 in part 1, 101 in part 2"),
        ({"kind": "film"}, r"camera c: kind: digital in part 1, film in part 2"),
    ],
)
def test_another_camera_under_one_id_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(AatriError, match=message):
        joined(ray_block(A, K), ray_block(B, K, **change))


def test_a_camera_with_a_parameter_in_one_block_alone_is_another() -> None:
    b = ray_block(B, K)
    more = type(b.camera_parameters).of(camera=[0], name=["k1"], value=[1e-9])
    with pytest.raises(AatriError, match="camera c: rows of camera_parameters: 0 in part 1, 1 in part 2"):
        joined(ray_block(A, K), replace(b, camera_parameters=more))


def test_control_here_and_check_point_there_is_refused() -> None:
    with pytest.raises(AatriError, match="role of ground point P: control in part 1, check in part 2"):
        joined(ray_block(A, K), ray_block(B, {"P": {"xyz_m": (10.001, 20, 30), "role": CHECK}}))


def test_measurements_too_far_apart_are_of_two_things() -> None:
    with pytest.raises(AatriError, match=r"image point 2/P .* 14.1 standard deviations .*too far for one thing"):
        joined(ray_block(A, K), ray_block({**B, "2/P": {"xy": (15, 6)}}, K))


def test_the_same_block_twice_and_a_part_of_it_are_refused() -> None:
    block = simulated("film")
    for again in (block, cut(block, "1")):
        with pytest.raises(InputError, match="holds nothing that part 1 does not hold: the same block twice"):
            joined(block, again)


def test_blocks_without_anything_in_common_are_refused_or_stand_side_by_side() -> None:
    a, b = ray_block(A, K), ray_block({f"9{k}X": v for k, v in B.items()}, {"L": {"xyz_m": (1, 2, 3)}})
    with pytest.raises(InputError, match="neither an image nor a point in common"):
        joined(a, b)
    assert len(joined(a, b, unconnected=True).images) == 4


def test_other_frames_are_refused_by_name() -> None:
    a, b = ray_block(A, K), ray_block(B, K)
    frames = replace(b.frames, crs=np.array(["EPSG:32650"]), axes=np.array(["east,north,up"]))
    with pytest.raises(InputError, match=r"part 1 is in the frame local .*, part 2 in EPSG:32650"):
        joined(a, replace(b, frames=frames))
    with pytest.raises(InputError, match="rotation is omega-phi-kappa in part 1, phi-omega-kappa in part 2"):
        joined(a, replace(b, rotation="phi-omega-kappa"))


def test_ids_get_a_prefix_but_for_the_common_ones() -> None:
    b = renamed(
        ray_block(A, K),
        RenamingOptions(prefix={"images": "e-", "points": "e-"}, rename={"images": {"2": "7"}}, common=["P"]),
    )
    assert b.images.id.tolist() == ["7", "e-1"]
    assert b.points.id.tolist() == ["P", "e-Q"]
    rows = b.image_points
    named = {f"{b.images.id[i]}/{b.points.id[p]}": xy.tolist() for i, p, xy in zip(rows.image, rows.point, rows.xy)}
    assert named == {"7/P": [5, 6], "e-1/P": [1, 2], "e-1/e-Q": [3, 4]}
    assert len(joined(ray_block(A, K), b).images) == 4


def test_ids_that_become_one_or_do_not_exist_are_refused() -> None:
    with pytest.raises(InputError, match="images 1, 2 would both be called 2"):
        renamed(ray_block(A, K), RenamingOptions(rename={"images": {"1": "2"}}))
    with pytest.raises(InputError, match="points has no X"):
        renamed(ray_block(A, K), RenamingOptions(rename={"points": {"X": "2"}}))


@pytest.mark.parametrize("name", BLOCKS)
def test_a_prefix_set_and_taken_off_again_changes_nothing(name: str) -> None:
    block = simulated(name)
    kinds: Any = ("images", "points", "cameras", "strips")
    there = renamed(block, RenamingOptions(prefix=dict.fromkeys(kinds, "x")))
    back = {kind: {f"x{i}": str(i) for i in getattr(block, kind).id} for kind in kinds}
    assert content_digest(renamed(there, RenamingOptions(rename=back))) == content_digest(block)


def test_a_part_of_no_image_is_refused(tmp_path: Path) -> None:
    write(ray_block(A, K), tmp_path / "b.h5")
    with pytest.raises(InputError, match="no strip has an id like 9"):
        part_stage(options=PartOptions(path=tmp_path / "b.h5", strips=["9"]))
    (tmp_path / "b.txt").write_text("?")
    with pytest.raises(InputError, match="neither a block folder nor the Block of a run"):
        part_stage(options=PartOptions(path=tmp_path / "b.txt", strips=["9"]))


def test_points_that_images_outside_of_a_part_show_too_keep_their_only_image_point(tmp_path: Path) -> None:
    block = simulated("film")
    write(block, tmp_path / "whole.h5")
    part = part_stage(options=PartOptions(path=tmp_path / "whole.h5", strips=["C1"]))
    assert isinstance(part, Block)
    rays = np.bincount(part.image_points.point, minlength=len(part.points))
    assert (rays == 1).any()
    assert part.image_points.active.all()
    assert not len(part.rejects)
