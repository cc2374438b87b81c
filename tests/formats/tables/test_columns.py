"""The declared columns are those of the contract, and of the tables of a Block."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aatri.artifacts import block as kinds
from aatri.formats.tables.columns import TABLES
from aatri.formats.tables.relative_control import FORMS, ConditionForm
from aatri.tables.schema import columns_of
from tests.stages.hand_block import hand, read

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


# Every value of relative control is in the unit of its type: lengths in that of the ground, angles in theirs.


LENGTHS, ANGLES = ("distance", "coordinate_difference", "sphere", "cylinder"), ("angle", "parallel", "perpendicular")
MM, GON = 1e-3, np.pi / 200


@pytest.mark.parametrize("type_", FORMS)
def test_values_and_standard_deviations_in_mm_and_gon(type_: str, tmp_path: Path) -> None:
    names = [f"p{k:02}" for k in range(8)]
    condition: dict[str, Any] = {"type": type_, "sigma": 0.5}
    if type_ in ("equal_distance", "parallel", "perpendicular"):
        condition["pairs"] = [names[:2], names[2:4]]
    elif type_ == "angle":
        condition |= {"at": names[0], "between": names[1:3], "value": 40.0}
    elif type_ in ("distance", "coordinate_difference"):
        condition |= {"points": names[:2], "value": 40.0} | ({"axis": "Z"} if type_ != "distance" else {})
    else:
        condition["points"] = names
        condition |= {"radius": 40.0} if FORMS[type_].value else {}
    (tmp_path / "relative_control.yaml").write_text(yaml.dump([condition]))
    units = {"ground": "mm", "angle": "gon", "sigma_image": "um", "sigma_ground": "cm", "sigma_angle": "deg"}
    control = read(tmp_path, hand(), more={"units": units})[0].relative_control
    unit = GON if type_ in ANGLES else MM
    assert control.sigma[0] == pytest.approx(0.5 * unit)
    if type_ in (*LENGTHS, "angle"):
        assert control.value[0] == pytest.approx(40 * unit)


def test_a_type_of_plain_numbers_is_not_scaled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FORMS, "ratio", ConditionForm(("pairs",), 4, "needed", unit="1"))
    condition = {"type": "ratio", "pairs": [["p00", "p01"], ["p02", "p03"]], "value": 1.5, "sigma": 0.01}
    (tmp_path / "relative_control.yaml").write_text(yaml.dump([condition]))
    control = read(tmp_path, hand(), more={"units": {"ground": "mm"}})[0].relative_control
    assert (control.value[0], control.sigma[0]) == (1.5, 0.01)
