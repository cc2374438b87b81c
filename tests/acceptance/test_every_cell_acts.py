"""Every cell of every table and every key of block.yaml that is read has an effect, or a message that names it.

Two small blocks use all columns and keys there are (`rich_blocks`). Each cell is changed by itself; then the
observation equations of the bundle change (and with them its result), a warning or an error tells what is wrong with
it, or a warning says by name that what it belongs to is not used.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aatri.errors import AatriError
from aatri.formats.tables import exterior, geodetic, ground, images
from tests.acceptance.folder_files import Folder
from tests.acceptance.rich_blocks import equations, made

OWN = {"aatri_block", "name"}
"""Keys that are no values."""

WORDS: dict[str, Any] = {
    "image": "i9",
    "point": "p99",
    "camera": "other",
    "strip": "t",
    "flight": "h",
    "session": "night",
    "rig": "Q",
    "member": "middle",
    "group": "x",
    "fiducial": "9",
    "role": "check",
    "datum": "no",
    "frame": "elsewhere",
    "use": "approximate",
    "drift_group": "h",
    "type": "dX",
    "from": "p27",
    "to": "p27",
    "via": "p27",
    "set": "s9",
    "reduced": "horizon",
    "row_a": "p24",
    "row_b": "p24",
    "coord_a": "Z",
    "coord_b": "Z",
    "axis": "X",
}
"""What stands in stead of a text."""

TURNED = {
    "yes": "no",
    "no": "yes",
    "projection_centre": "antenna",
    "antenna": "projection_centre",
    "dX": "dY",
    "image": "point",
    "point": "image",
    "ground_points": "geodetic",
    "geodetic": "ground_points",
    "true": "grid",
}

ROWS: dict[str, dict[str, tuple[int, ...]]] = {
    "film": {
        "images": (0, 1, 2, 3),  # a strip, and the first of the next, which is observed in part
        "image_points": (0, 1, 7, 8, 11, 12),
        "fiducials": (0, 1, 2, 5),
        "ground_points": (0, 1, 3, 4, 5, 6),
        "exterior": (0, 1, 2, 3, 4),
        "geodetic": (0, 1, 4, 5, 6, 7, 8, 9, 10, 12, 13, 14, 15),  # of a group and of a set the first, and another
    },
    "digital": {"images": (0, 1, 2), "image_points": (0, 12), "ground_points": (0, 4), "exterior": (0, 1, 2)},
}
"""Rows that are looked at, of each kind one; of tables that are not named all."""

Change = tuple[str, tuple[Any, ...], Any]
"""Table or file, the way to the cell, and the new value."""


def changed(value: Any, name: str) -> Any:
    """Another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        if value in (0, float("inf")) and name != "sequence":
            return 0.01 if value == 0 else 0.5
        if name == "sequence":  # a place among others
            return value - 1.5 if value > 1 else value + 1.5
        return value * 1.1 if abs(value) < 50 else value + 0.3 * max(1.0, abs(value) * 1e-7)
    return WORDS.get(name, f"{value}x")


def cells(folder: Folder) -> Iterator[Change]:
    """All changes of a block, one cell each."""
    for table, rows in folder.tables.items():
        for k in ROWS[folder.settings["name"]].get(table, range(len(rows))):
            for column, value in rows[k].items():
                if value != "":
                    new = TURNED.get(str(value)) or changed(value, column)
                    yield table, (k, column), new
    for keys, value in _leaves(folder.conditions):
        yield (
            "relative_control.yaml",
            keys,
            "p27" if isinstance(value, str) and value.startswith("p") else changed(value, str(keys[-1])),
        )
    for keys, value in _leaves(folder.settings):
        if keys[0] not in OWN:
            yield "block.yaml", keys, TURNED.get(str(value)) or changed(value, str(keys[-1]))


def _leaves(value: Any, before: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    items = [*value.items()] if isinstance(value, dict) else [*enumerate(value)] if isinstance(value, list) else None
    if items and isinstance(value, list) and isinstance(value[0], str):
        items = [*items[:2], *items[2:][-1:]]  # of many ids: all others of them stand for the same
    if items is None:
        yield before, value
    else:
        for key, inner in items:
            yield from _leaves(inner, (*before, key))


def apply(folder: Folder, change: Change) -> Folder:
    """The folder with one cell changed; its other tables are the same objects."""
    where, keys, value = change
    if where in folder.tables:
        return replace(folder, tables=folder.tables | {where: _with(folder.tables[where], keys, value)})
    if where == "block.yaml":
        return replace(folder, settings=_with(folder.settings, keys, value))
    return replace(folder, conditions=_with(folder.conditions, keys, value))


def _with(part: Any, keys: tuple[Any, ...], value: Any) -> Any:
    """A copy, along the way to what is changed."""
    if not keys:
        return value
    copied = copy.copy(part)
    copied[keys[0]] = _with(part[keys[0]], keys[1:], value)
    return copied


@functools.cache
def as_it_is(which: str, folder: Path) -> tuple[Folder, bytes, tuple[str, ...]]:
    content = made(which)
    return content, *equations(folder, content)


def idle(which: str, changes: list[Change], folder: Path) -> list[Change]:
    """Changes that change nothing, and are told by nobody."""
    content, digest, told = as_it_is(which, folder / which)
    found = []
    for change in changes:
        try:
            now, says = equations(folder / which, apply(content, change))
        except AatriError:
            continue
        column = f"{change[0]}.csv: {change[1][-1]}"
        if now == digest and says == told and not any(column in text for text in told):
            found.append(change)
    return found


def _name(change: Change) -> str:
    """Table and column, or the key without numbers."""
    where, keys, _ = change
    return (
        f"{where}:{keys[-1]}" if where in made_tables() else ".".join([where, *(k for k in keys if isinstance(k, str))])
    )


def made_tables() -> tuple[str, ...]:
    return ("images", "image_points", "fiducials", "ground_points", "exterior", "geodetic", "covariances")


def by_name(which: str) -> dict[str, list[Change]]:
    found: dict[str, list[Change]] = {}
    for change in cells(made(which)):
        if which != "cylinder" or change[0] == "relative_control.yaml":
            found.setdefault(_name(change), []).append(change)
    return found


CASES = [(which, name) for which in ("film", "digital", "cylinder") for name in by_name(which)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("every_cell")


@pytest.mark.parametrize("which", ROWS)
def test_the_rows_that_are_looked_at_have_every_column_and_every_word_of_the_whole(which: str) -> None:
    words = ("type", "role", "from_kind", "to_kind", "reduced", "refers_to", "camera", "rig", "member", "group", "set")
    for table, rows in made(which).tables.items():
        sample = [rows[k] for k in ROWS[which].get(table, range(len(rows)))]
        columns, looked_at = ({c for row in part for c, v in row.items() if v != ""} for part in (rows, sample))
        assert looked_at == columns, table
        assert all({row.get(c) for row in sample} == {row.get(c) for row in rows} for c in words), table


@pytest.mark.slow
@pytest.mark.parametrize(("which", "name"), CASES)
def test_every_cell_has_an_effect_or_a_message(which: str, name: str, folder: Path) -> None:
    assert idle(which, by_name(which)[name], folder) == []


def test_the_blocks_use_every_column() -> None:
    columns: dict[str, set[str]] = {}
    for which in ("film", "digital"):
        for table, rows in made(which).tables.items():
            columns.setdefault(table, set()).update(c for row in rows for c, value in row.items() if value != "")
    declared = {
        "images": images.IMAGES,
        "image_points": images.IMAGE_POINTS,
        "fiducials": images.FIDUCIALS,
        "ground_points": ground.GROUND_POINTS,
        "exterior": exterior.EXTERIOR,
        "geodetic": geodetic.GEODETIC,
    }
    for table, known in declared.items():
        assert set(known) - columns[table] <= {"path", "mask", "row_time"}, table
