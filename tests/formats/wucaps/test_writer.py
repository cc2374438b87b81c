"""WuCAPS files written: read again they give the same block, and what has no place in them is refused or told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, Block
from aatri.errors import AatriError
from aatri.formats.wucaps.writer import write_wucaps
from aatri.tables.schema import tables_of
from tests.made_solutions import made_block
from tests.reading import read_wucaps


def _ground_of(block: Block) -> dict[str, tuple[list[float], list[int]]]:
    g = block.ground_points
    return {str(block.points.id[p]): (x, r) for p, x, r in zip(g.point, g.xyz_m.tolist(), g.role.tolist())}


def _changed(block: Block, table: str, **columns: Any) -> Block:
    return replace(block, **{table: replace(getattr(block, table), **columns)})


def test_the_real_block_is_read_again_as_it_was(tmp_path: Path, shared_data: Path) -> None:
    block = read_wucaps(shared_data / "rc30_2x3/Data/bundle_ajustment")
    notes = write_wucaps(block, tmp_path / "again")
    again = read_wucaps(tmp_path / "again")
    for name in set(tables_of(Block)) - {"files"}:
        one, other = getattr(block, name), getattr(again, name)
        for column in () if one is None else set(vars(one)) - {"file", "line"}:
            np.testing.assert_array_equal(getattr(one, column), getattr(other, column), err_msg=f"{name}.{column}")
    assert [n.level for n in notes] == ["note"]


def test_a_made_block_comes_back_with_its_coordinates_and_roles(tmp_path: Path) -> None:
    block = made_block()
    role = block.ground_points.role.copy()
    role[0], role[1], role[2], role[3] = (
        [CONTROL, CONTROL, NO_ROLE],
        [NO_ROLE, NO_ROLE, CONTROL],
        [CHECK] * 3,
        [NO_ROLE] * 3,
    )
    block = _changed(block, "ground_points", role=role)
    write_wucaps(block, tmp_path / "new" / "folder")
    again = read_wucaps(tmp_path / "new" / "folder")
    assert _ground_of(again) == _ground_of(block)
    assert again.cameras.principal_distance_mm[0] == 150.0
    assert again.images.strip.tolist() == block.images.strip.tolist()
    np.testing.assert_array_equal(again.image_points.xy, block.image_points.xy)
    np.testing.assert_array_equal(again.image_points.image, block.image_points.image)


def test_what_is_not_used_or_not_known_is_left_out_and_said(tmp_path: Path) -> None:
    block = made_block()
    active, xyz, role = (
        block.image_points.active.copy(),
        block.ground_points.xyz_m.copy(),
        block.ground_points.role.copy(),
    )
    active[[3, 7]] = False
    xyz[0, 2], role[0] = np.nan, [CONTROL, CONTROL, NO_ROLE]
    xyz[1, 0], role[1] = np.nan, [NO_ROLE] * 3
    block = _changed(_changed(block, "image_points", active=active), "ground_points", xyz_m=xyz, role=role)
    notes = [str(n) for n in write_wucaps(block, tmp_path) if n.level == "warning"]
    first, second = block.points.id[block.ground_points.point[:2]]
    assert sorted(notes) == [
        f"0 stands for coordinates that are not known, of plan or height control: {first}",
        "2 unused image points are not written",
        f"ground points that lack a coordinate are not written: {second}",
    ]
    again = read_wucaps(tmp_path)
    assert len(again.image_points) == len(block.image_points) - 2
    assert _ground_of(again)[str(first)] == ([*xyz[0, :2].tolist(), 0.0], [CONTROL, CONTROL, NO_ROLE])
    assert str(second) not in _ground_of(again)


@pytest.mark.parametrize(
    ("table", "columns", "said"),
    [
        ("cameras", {"image_coordinates": np.array(["pixel"])}, "camera cam: pixel coordinates, WuCAPS"),
        ("cameras", {"distortion": np.array(["brown"])}, "camera cam: distortion brown has no place"),
        ("images", {"strip": np.full(10, -1)}, "images without a strip: 1-0, 1-1"),
        ("images", {"id": np.array(["-5", *(f"i{k}" for k in range(9))])}, "read otherwise: -5"),
        ("points", {"id": np.array(["-99", *(f"p{k}" for k in range(19))])}, "read otherwise: -99"),
        ("points", {"id": np.array(["p q", *(f"p{k}" for k in range(19))])}, "read otherwise: p q"),
        ("points", {"id": np.array(["pü", *(f"p{k}" for k in range(19))])}, "read otherwise: pü"),
    ],
)
def test_what_has_no_form_is_refused_by_name(tmp_path: Path, table: str, columns: dict[str, Any], said: str) -> None:
    with pytest.raises(AatriError, match=said.replace("(", "\\(")):
        write_wucaps(_changed(made_block(), table, **columns), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_role_without_a_form_is_refused(tmp_path: Path) -> None:
    block = made_block()
    role = block.ground_points.role.copy()
    role[2] = [CONTROL, CHECK, CONTROL]
    name = block.points.id[block.ground_points.point[2]]
    with pytest.raises(AatriError, match=f"control or check: {name}"):
        write_wucaps(_changed(block, "ground_points", role=role), tmp_path)
