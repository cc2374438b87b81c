"""One edit of a block, what may stand in it, and edits.yaml, a list of edits.

    do: switch_off   kind with its ids; of control and positions `coordinates: XZ` of them only
    do: renumber     an image point is of the point `to`
    do: exchange     of an image point or control point with the point `to`, of a position with the image `to`
    do: reweight     standard deviations of a kind, or of one of its image, point, `group`, times `factor`;
                     of control and positions `coordinates: Z` of them only

`value` is what was measured when the edit was proposed: an edit whose observation has another value by now is refused.

edits.yaml is read with the place of each edit, and written line by line:

edits:
  - {do: switch_off, kind: image_point, image: "0103", point: P12, value: [12.345, -45.6], reason: "34 um"}
  - {do: exchange, kind: control, point: P1, to: P2}
"""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from aatri.errors import Faults, InputError, raise_all
from aatri.formats.text.written_files import write_files
from aatri.ids import clipped, did_you_mean
from aatri.strict_yaml import Document, load

ACTIONS = ("switch_off", "renumber", "exchange", "reweight")

NAMED_BY = {
    "image_point": ("image", "point"),
    "fiducial": ("image", "point"),
    "control": ("point",),
    "position": ("image",),
    "attitude": ("image",),
}
"""What names an observation of a kind; every other kind is a type of geodetic.csv, named by `from`, `to` and `via`."""

GEODETIC = ("from", "to")

TAKES = {
    "switch_off": (*NAMED_BY, "geodetic"),
    "renumber": ("image_point",),
    "exchange": ("image_point", "control", "position"),
    "reweight": ("image_point", "control", "position", "attitude", "geodetic"),
}
"""The kinds that an action is for."""

BY_COORDINATE = {"control", "position"}
"""Kinds of which single coordinates can be switched off and reweighted."""

KEYS = ("do", "kind", "image", "point", "from", "to", "via", "group", "coordinates", "value", "factor", "reason")

HEAD = """\
# Edits of a block: what was measured stays as it is, and is read as if it had been changed so. Delete a line, or the
# file, to undo it. Written by `aatri edit`; see docs/methods/editing.md.
edits:
"""


@dataclass(frozen=True)
class Edit:
    """One edit."""

    do: str
    """switch_off, renumber, exchange, reweight."""
    kind: str
    """image_point, fiducial, control, position, attitude, or a type of geodetic observation."""
    ids: dict[str, str]
    """By the keys image, point, from, to, via, group."""
    coordinates: str = "XYZ"
    """Those of X, Y, Z that are meant."""
    value: tuple[float, ...] = ()
    """As measured: mm or px of an image point, m (east, north, up) of control and positions, rad of attitudes, m or
    rad of geodetic observations; empty: not compared."""
    factor: float = 1.0
    """On standard deviations."""
    reason: str = ""
    where: str = ""
    """`file:line:column`."""

    @property
    def family(self) -> str:
        """The kind, or `geodetic`."""
        return self.kind if self.kind in NAMED_BY else "geodetic"

    def same_as(self, other: "Edit") -> bool:
        """Whether both change the same observation in the same way, whatever the reason; weights may change again."""
        return self.do != "reweight" and replace(self, reason="", where="") == replace(other, reason="", where="")

    def __str__(self) -> str:
        words = [self.do, self.kind, *(word for name in self.ids.items() for word in name)]
        if self.coordinates != "XYZ":
            words.insert(2, self.coordinates)
        return " ".join(words) + (f" x {self.factor:g}" if self.do == "reweight" else "")


def read_edits(path: Path) -> tuple[Edit, ...]:
    """The edits of a file.

    Raises
    ------
    InputError
        With file, line and column of everything that cannot be read.
    """
    document, faults = load(path, InputError), Faults()
    entries = document.value.get("edits") if isinstance(document.value, dict) else None
    if not isinstance(entries, list) or set(document.value) != {"edits"}:
        raise InputError(
            "is no list of edits", where=document.where(), remedy="begin with `edits:`, one `- {do: ` each"
        )
    entries_read = (_edit(document, k, faults) for k in range(len(entries)))
    edits = [edit for edit in entries_read if edit is not None]
    for k, edit in enumerate(edits):
        first = next((one for one in edits[:k] if one.same_as(edit)), None)
        if first is not None:
            faults.add(f"{edit}: is written twice (first: {first.where})", edit.where, "delete one of the two lines")
    raise_all(faults)
    return tuple(edits)


def write_edits(path: Path, edits: Iterable[Edit]) -> None:
    """Write a file of edits, whole or not at all.

    Raises
    ------
    ResourceError
        If it cannot be written.
    """
    write_files(path.parent, {path.name: HEAD + "".join(f"  - {_line(edit)}\n" for edit in edits)})


def _line(edit: Edit) -> str:
    entry: dict[str, Any] = {"do": edit.do, "kind": edit.kind, **edit.ids}
    if edit.coordinates != "XYZ":
        entry["coordinates"] = edit.coordinates
    if edit.value:
        entry["value"] = list(edit.value)
    if edit.do == "reweight":
        entry["factor"] = edit.factor
    if edit.reason:
        entry["reason"] = edit.reason
    plain = (
        f"{key}: {value if key == 'do' else json.dumps(value, ensure_ascii=False)}" for key, value in entry.items()
    )
    return "{" + ", ".join(plain) + "}"


def _edit(document: Document, k: int, faults: Faults) -> Edit | None:
    """One entry; None where something is wrong with it."""
    entry, before = document.value["edits"][k], len(faults)
    where = document.where("edits", k)
    if not isinstance(entry, dict):
        faults.add("is no edit", where, "write `{do: switch_off, kind: image_point, image: ..., point: ...}`")
        return None
    for key in entry:
        if key not in KEYS:
            faults.add(f"unknown key {clipped(key)}{did_you_mean(key, KEYS)}", document.where_key("edits", k, key))
    texts = {key: document.text("edits", k, key) for key in KEYS if key in entry and key not in ("value", "factor")}
    do, kind = texts.pop("do", ""), texts.pop("kind", "")
    coordinates, reason = texts.pop("coordinates", "XYZ"), texts.pop("reason", "")
    if do not in ACTIONS:
        what = f"the edit has `do: {clipped(do)}`, which is no action" if do else "the edit lacks `do`, its action"
        faults.add(what, where, f"write one of {', '.join(ACTIONS)}")
        return None
    family = kind if kind in NAMED_BY else "geodetic"
    if not kind or family not in TAKES[do]:
        faults.add(f"{do} of {clipped(kind) if kind else 'nothing'}", where, f"it takes {', '.join(TAKES[do])}")
        return None
    needed = NAMED_BY.get(kind, GEODETIC) if do != "reweight" else ()
    needed += ("to",) if do in ("renumber", "exchange") else ()
    lacking = [key for key in needed if not texts.get(key)]
    if lacking:
        faults.add(f"{do} of a {kind} lacks {', '.join(lacking)}", where, f"it is named by {', '.join(needed)}")
    meaning = {
        "coordinates": kind in BY_COORDINATE and do in ("switch_off", "reweight"),
        "factor": do == "reweight",
        "to": "to" in needed or family == "geodetic",
    }
    for key in (key for key, means in meaning.items() if key in entry and not means):
        faults.add(f"{do} of {kind} takes no {key}", document.where_key("edits", k, key), "leave it out")
    if not coordinates or set(coordinates) - set("XYZ"):
        faults.add(f"coordinates are {clipped(coordinates)}", where, "some of X, Y, Z: `coordinates: XZ`")
    value, factor = _numbers(entry.get("value", [])), _numbers([entry.get("factor", 1.0)])
    if value is None or factor is None or factor[0] <= 0:
        faults.add("value or factor is no number, or not positive", where, "value: [x, y], factor: 1.5")
    if do == "reweight" and "factor" not in entry:
        faults.add("reweight lacks factor", where, "factor: 1.5 makes standard deviations 1.5 times as large")
    if len(faults) > before or value is None or factor is None:
        return None
    return Edit(do, kind, texts, coordinates, value, factor[0], reason, where)


def _numbers(values: Any) -> tuple[float, ...] | None:
    values = values if isinstance(values, list) else [values]
    if any(isinstance(v, bool) or not isinstance(v, int | float) or not math.isfinite(v) for v in values):
        return None
    return tuple(float(v) for v in values)
