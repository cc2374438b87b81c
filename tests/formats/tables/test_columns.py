"""The declared columns are those of the contract, and of the tables of a Block."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from aatri.artifacts import block as kinds
from aatri.formats.tables.columns import TABLES
from aatri.tables.schema import columns_of

PAGE = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8")
OF_BLOCK = {
    "images.csv": kinds.Images,
    "image_points.csv": kinds.MeasuredPoints,
    "fiducials.csv": kinds.FiducialPoints,
    "ground_points.csv": kinds.GroundPoints,
    "exterior.csv": kinds.Exterior,
    "geodetic.csv": kinds.Geodetic,
}


@pytest.mark.parametrize("name", TABLES)
def test_docs_list_the_columns_those_that_must_be_there_first(name: str) -> None:
    listed = re.search(rf"^\| `{name}` \| (.*) \|$", PAGE, re.M)
    assert listed is not None
    needed, optional = (part.split(", ") for part in re.split(r" \(|: ", listed[1])[0].split("; "))
    must = [column for column, stated in TABLES[name].items() if stated.cell.must]
    assert needed == must
    assert optional == [column for column in TABLES[name] if column not in must]


@pytest.mark.parametrize("name", OF_BLOCK)
def test_every_column_fills_one_of_the_block_and_components_are_all_there(name: str) -> None:
    declared = columns_of(OF_BLOCK[name])
    parts: dict[str, list[int]] = {}
    for stated in (stated for stated in TABLES[name].values() if stated.field):
        assert stated.field in declared
        parts.setdefault(stated.field, []).extend([] if stated.part is None else [stated.part])
    assert {field: sorted(k) for field, k in parts.items() if k} == {
        field: list(range(*declared[field].shape)) for field, k in parts.items() if k
    }
