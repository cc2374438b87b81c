"""A Block from columns: ids become rows, the order of the reader does not matter, the rest has its default."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.builder import block_of
from aatri.errors import ArtifactError, InputError
from aatri.tables.digest import content_digest


def _columns(order: tuple[int, ...] = (0, 1, 2)) -> dict[str, Any]:
    images = np.array(["b", "a", "ä"])[list(order)]
    return {
        "name": "made",
        "files": [Path("made.txt")],
        "cameras": {"id": ["c"], "principal_distance_mm": [100.0]},
        "images": {"id": images, "camera": ["c"] * 3, "strip": ["2", "1", ""], "file": [0] * 3, "line": [4, 5, 6]},
        "image_points": {
            "image": images[[0, 1, 2]],
            "point": ["Q", "P", "Q"],
            "xy": np.arange(6.0).reshape(3, 2)[list(order)],
            "sigma_mm": np.full((3, 2), 0.01),
        },
        "ground_points": {"point": ["R", "P"], "xyz_m": np.eye(2, 3), "role": np.full((2, 3), CONTROL)},
    }


def _block(**changes: Any) -> Block:
    return block_of(**{**_columns(), **changes})


def test_rows_follow_the_ids_in_canonical_order() -> None:
    block = _block()
    assert block.images.id.tolist() == ["a", "b", "ä"]
    assert block.strips.id.tolist() == ["1", "2"]
    assert block.images.strip.tolist() == [0, 1, -1]
    assert block.points.id.tolist() == ["P", "Q", "R"]
    assert block.image_points.image.tolist() == [0, 1, 2]
    assert block.image_points.point.tolist() == [0, 1, 1]
    assert block.image_points.xy.tolist() == [[2.0, 3.0], [0.0, 1.0], [4.0, 5.0]]
    assert block.ground_points.point.tolist() == [0, 2]
    assert block.ground_points.xyz_m.tolist() == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]


def test_what_is_not_stated_has_its_default() -> None:
    block = _block()
    assert block.cameras.kind.tolist() == ["digital"]
    assert block.cameras.principal_point_mm.tolist() == [[0.0, 0.0]]
    assert np.isnan(block.images.time_s).all()
    assert block.image_points.active.all()
    assert block.image_points.file.tolist() == [-1, -1, -1]
    assert len(block.exterior) == len(block.geodetic) == 0
    assert block.earth_curvature == "ignore"


def test_numbers_count_in_the_order_of_the_reader() -> None:
    named, counted = _columns(), _columns()
    named["points"] = counted["points"] = ["Q", "P", "R"]
    counted["image_points"] |= {"image": np.arange(3), "point": np.array([0, 1, 0])}
    assert content_digest(block_of(**named)) == content_digest(block_of(**counted))


@pytest.mark.parametrize("name", ["images", "image_points", "ground_points"])
def test_the_order_of_rows_does_not_matter(name: str) -> None:
    columns = _columns()
    turned = {key: np.asarray(values)[::-1] for key, values in columns[name].items()}
    assert content_digest(_block(**{name: turned})) == content_digest(_block())


@pytest.mark.parametrize(
    ("table", "change", "message", "where"),
    [
        ("images", {"id": ["a", "b", "b"]}, "image b stands twice", "made.txt:6"),
        ("images", {"camera": ["c", "x", "c"]}, "camera x is named, but not given", "made.txt:5"),
        ("image_points", {"image": ["a", "b", "z"]}, "image z is named, but not given", "made.txt"),
    ],
)
def test_an_id_that_is_wrong_is_told_with_its_line(
    table: str, change: dict[str, Any], message: str, where: str
) -> None:
    with pytest.raises(InputError, match=message) as told:
        _block(**{table: _columns()[table] | change})
    assert told.value.where == where


def test_a_column_that_has_no_default_or_does_not_exist_is_named() -> None:
    with pytest.raises(ArtifactError, match="missing: principal_distance_mm"):
        _block(cameras={"id": ["c"]})
    with pytest.raises(ArtifactError, match="no column focal_length"):
        _block(cameras={"id": ["c"], "principal_distance_mm": [1.0], "focal_length": [1.0]})
