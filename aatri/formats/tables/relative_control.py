"""relative_control.yaml as tables, and back: conditions on points or projection centres.

A list of `{type, points | images | pairs | at and between, value, sigma | exact, axis, radius}`. `sigma` makes a
condition an observation, `exact: true` a constraint (standard deviation 0). Values are in the block's ground or angle
unit, or plain numbers, as the type has it. Conditions come out sorted by type, axis, members and value; the order of
the members is kept.
"""

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from aatri.artifacts.block import Block, RelativeControl, RelativeControlMembers
from aatri.errors import InputError
from aatri.formats.tables.geodetic import right_handed_axis
from aatri.formats.tables.source import FILES, Source
from aatri.ids import clipped, did_you_mean
from aatri.strict_yaml import Document, load
from aatri.units import ANGLE_RAD, LARGEST

FILE = "relative_control.yaml"


class ConditionForm(NamedTuple):
    """What a type takes: its members, the least number of them, and its value."""

    members: tuple[str, ...]
    least: int
    value: str = ""
    exactly: bool = False
    """It takes no more than the least number."""
    unit: Literal["m", "rad", "1"] = "m"
    """Of its value and standard deviation: in the tables the block's ground unit, its angle unit, or a plain number."""


FORMS = {
    "distance": ConditionForm(("points", "images"), 2, "needed", exactly=True),
    "equal_distance": ConditionForm(("pairs",), 4),
    "horizontal_plane": ConditionForm(("points",), 2),
    "vertical_plane": ConditionForm(("points",), 3),
    "plane": ConditionForm(("points",), 4),
    "plumb_line": ConditionForm(("points",), 2),
    "line": ConditionForm(("points",), 3),
    "horizontal_line": ConditionForm(("points",), 2),
    "angle": ConditionForm(("at", "between"), 3, "needed", exactly=True, unit="rad"),
    "equal_height": ConditionForm(("points",), 2),
    "coordinate_difference": ConditionForm(("points",), 2, "needed", exactly=True),
    "parallel": ConditionForm(("pairs",), 4, exactly=True, unit="rad"),
    "perpendicular": ConditionForm(("pairs",), 4, exactly=True, unit="rad"),
    "sphere": ConditionForm(("points",), 4, "optional"),
    "cylinder": ConditionForm(("points",), 5, "optional"),
}
KEYS = ("type", "points", "images", "pairs", "at", "between", "value", "radius", "sigma", "exact", "axis")


class Condition(NamedTuple):
    """One condition in inner units."""

    type: str
    axis: str
    members: tuple[tuple[str, str], ...]
    value: float
    sigma: float
    line: int
    file: int = FILES.index(FILE)

    @property
    def place(self) -> Any:
        """What the canonical order goes by."""
        members = tuple((part.encode(), name.encode()) for part, name in self.members)
        return self.type, self.axis, members, float(np.nan_to_num(self.value, nan=-1.0)), self.sigma


def relative_control_tables(
    source: Source, images: Iterable[str], points: Iterable[str], more: tuple[Condition, ...] = ()
) -> tuple[RelativeControl, RelativeControlMembers]:
    """Read relative_control.yaml, if it is there; `more` conditions come from elsewhere."""
    path = source.folder / FILE
    if not os.path.lexists(path):
        return tables_of_conditions(more)
    document = load(path, InputError)
    if not isinstance(document.value, list):
        raise InputError("is no list of conditions", where=document.where(), remedy="begin each one with `- {type: `")
    ids = {"images": set(images), "points": set(points)}
    read = [_condition(source, document, k, ids) for k in range(len(document.value))]
    first: dict[Any, int] = {}
    for c in read:
        if c is not None and first.setdefault(c.place, c.line) != c.line:
            what = f"{c.type} is equal to that of line {first[c.place]} in every digit: they count once"
            source.reporter.warn(f"{path}:{c.line}: {what}")
    return tables_of_conditions([*(c for c in read if c is not None and first[c.place] == c.line), *more])


def conditions_of(block: Block) -> list[Condition]:
    """The conditions of a block."""
    rows, members = block.relative_control, block.relative_control_members
    listed: list[list[tuple[str, str]]] = [[] for _ in range(len(rows))]
    for k, part, name in zip(members.condition.tolist(), members.part.tolist(), members.id.tolist()):
        listed[k].append((part, name))
    names = ("type", "axis", "value", "sigma", "line", "file")
    cells = zip(*(getattr(rows, name).tolist() for name in names))
    return [Condition(members=tuple(of), **dict(zip(names, row))) for of, row in zip(listed, cells)]


def tables_of_conditions(conditions: Iterable[Condition]) -> tuple[RelativeControl, RelativeControlMembers]:
    """The tables of conditions, in canonical order."""
    conditions = sorted(conditions, key=lambda c: c.place)
    members = [(k, part, name) for k, c in enumerate(conditions) for part, name in c.members]
    return (
        RelativeControl.of(
            type=[c.type for c in conditions],
            value=[c.value for c in conditions],
            sigma=[c.sigma for c in conditions],
            axis=[c.axis for c in conditions],
            file=[c.file for c in conditions],
            line=[c.line for c in conditions],
        ),
        RelativeControlMembers.of(
            condition=[m[0] for m in members], part=[m[1] for m in members], id=[m[2] for m in members]
        ),
    )


def relative_control_text(block: Block, table_axis: Mapping[str, str]) -> str:
    """The conditions in m and rad; `table_axis` says what the tables call the axes X, Y, Z of the block."""
    rows, members = block.relative_control, block.relative_control_members
    lines = []
    for k in range(len(rows)):
        own = members.condition == k
        item: dict[str, Any] = {"type": str(rows.type[k])}
        for part in dict.fromkeys(members.part[own].tolist()):
            ids = members.id[own & (members.part == part)].tolist()
            if part == "pairs":
                item[part] = [ids[i : i + 2] for i in range(0, len(ids), 2)]
            else:
                item[part] = ids[0] if part == "at" else ids
        if np.isfinite(rows.value[k]):
            item["radius" if rows.type[k] in ("sphere", "cylinder") else "value"] = float(rows.value[k])
        if rows.axis[k]:
            item["axis"] = table_axis[str(rows.axis[k])]
        item |= {"sigma": float(rows.sigma[k])} if rows.sigma[k] > 0 else {"exact": True}
        lines.append(f"- {json.dumps(item, ensure_ascii=False)}\n")
    return "".join(lines)


def _condition(source: Source, document: Document, k: int, ids: dict[str, set[str]]) -> Condition | None:
    """One item of the list; None if it has faults, which are kept."""
    item, before = document.value[k], len(source.problems)

    def fault(what: str, *keys: str | int, remedy: str = "") -> None:
        source.problems.add(what, document.where(k, *keys), remedy)

    kind = str(item.get("type", "")) if isinstance(item, dict) else ""
    if kind not in FORMS:
        fault(
            f"unknown condition {clipped(kind)!r}{did_you_mean(kind, FORMS)}",
            "type",
            remedy=f"types are {', '.join(FORMS)}",
        )
        return None
    item = {key: value for key, value in item.items() if not key.startswith("x_")}
    form = FORMS[kind]
    for key in item:
        if key not in KEYS:
            fault(f"unknown key {clipped(key)!r}{did_you_mean(key, KEYS)}", key, remedy="your own start with x_")
        elif key in ("points", "images", "pairs", "at", "between") and key not in form.members:
            fault(f"{kind} does not take `{key}`", key, remedy=f"it takes {' or '.join(form.members)}")
    members = _members(document, k, item, form)
    if len(members) < form.least or (form.exactly and len(members) > form.least):
        takes = "exactly" if form.exactly else "at least"
        fault(f"{kind} has {len(members)} members", remedy=f"it takes {takes} {form.least}")
    if "pairs" in form.members and len(members) % 2:
        fault("pairs are two ids each", "pairs", remedy="write [[A, B], [C, D]]")
    if form.members[0] != "pairs" and len(set(members)) < len(members):
        fault(f"{kind} names a member twice", remedy="remove it")
    for part, name in members:
        where = "images" if part == "images" else "points"
        if name not in ids[where]:
            fault(
                f"{where[:-1]} {clipped(name)!r} is unknown{did_you_mean(name, ids[where])}",
                part,
                remedy="mend the id; points must be measured or in ground_points.csv",
            )
    value, sigma = _figures(source, item, kind, form, fault)
    axis = str(item.get("axis") or "")
    if (kind == "coordinate_difference") != (axis in ("X", "Y", "Z")) or (axis and axis not in ("X", "Y", "Z")):
        fault(f"axis is {axis!r}", "axis", remedy="a coordinate_difference, and only it, has axis: X, Y or Z")
    if source.default_frame and axis and right_handed_axis(source, axis) != "Z":
        fault(
            "a difference in an axis of the first frame, which is in degrees",
            "axis",
            remedy="make a map the first frame",
        )
    if len(source.problems) > before:
        return None
    line = int(document.where(k).rsplit(":", 2)[1])
    return Condition(kind, right_handed_axis(source, axis) if axis else "", tuple(members), value, sigma, line)


def _members(document: Document, k: int, item: dict[str, Any], form: ConditionForm) -> list[tuple[str, str]]:
    """Ids as they are written, with the part they play."""
    members = []
    for part in form.members:
        if part not in item:
            continue
        nested = item[part]
        if not isinstance(nested, list):
            members.append((part, document.text(k, part)))
            continue
        for i, inner in enumerate(nested):
            if isinstance(inner, list):
                members += [(part, document.text(k, part, i, j)) for j in range(len(inner))]
            else:
                members.append((part, document.text(k, part, i)))
    return members


def _figures(source: Source, item: dict[str, Any], kind: str, form: ConditionForm, fault: Any) -> tuple[float, float]:
    """Value and standard deviation in the unit of the type."""
    units = source.settings.units
    factor = {"m": units.ground_m, "rad": ANGLE_RAD["deg" if units.angle == "dms" else units.angle or "rad"], "1": 1.0}
    if form.unit == "rad" and units.angle is None and ("value" in item or "sigma" in item):
        fault(f"units.angle is missing in block.yaml, but {kind} is an angle", remedy="add units: {angle: deg}")
    key = "radius" if form.value == "optional" else "value"
    for name in ("value", "radius", "sigma"):
        if name in item and (
            isinstance(item[name], bool) or not isinstance(item[name], int | float) or not abs(item[name]) <= LARGEST
        ):
            fault(f"{name} is {item[name]!r}, not a number", name, remedy="write a plain number")
            return np.nan, np.nan
    for name in ("value", "radius"):
        if name in item and (name != key or not form.value):
            fault(f"{kind} has no `{name}`", name, remedy="remove it")
    if form.value == "needed" and key not in item:
        fault(f"{kind} needs `value`", remedy="add value: ...")
    exact = item.get("exact")
    if exact not in (None, True, False) or (exact is True) == ("sigma" in item):
        fault(
            f"{kind} needs either `sigma` or `exact: true`", remedy="sigma makes it an observation, exact a constraint"
        )
    elif "sigma" in item and item["sigma"] <= 0:
        fault(f"sigma is {item['sigma']}", "sigma", remedy="more than 0; for a constraint write exact: true")
    value = float(item[key]) * factor[form.unit] if key in item else np.nan
    return value, float(item.get("sigma", 0.0)) * factor[form.unit]
