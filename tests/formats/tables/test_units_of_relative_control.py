"""Every value of relative control is in the unit of its type: lengths in that of the ground, angles in theirs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aatri.formats.tables.relative_control import FORMS, ConditionForm
from tests.stages.hand_block import hand, read

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
