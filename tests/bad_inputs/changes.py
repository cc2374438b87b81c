"""What a row of a table of bad inputs changes in the tables of a block.

    {file: images.csv, text: "..."}               the whole text; encoding: utf-16, ends: "\r\n" write it otherwise
    {file: images.csv, bytes: "..."}              the same, a character a byte
    {file: images.csv, replace: old, by: new}     the first place of a text
    {file: images.csv, append: "..."}             further text
    {file: images.csv, before: "..."}             the text before a place
    {file: images.csv, remove: true}              no such file; link: TARGET makes it a link
    {file: images.csv, of_memory: 0.1}            a hole behind the text, up to a share of the machine's memory
    {points: {old: new}}                          other ids of points, without geodetic and relative control
    ..., repeat: 300                              `by` or `append` so many times

Changes of cells: `rows: {column: pattern}` says of which rows (else of all), `but: {column: pattern}` of which not; a
pattern has * and ?, or is a list of them, and several sets of patterns are a list:

    {file: exterior.csv, rows: {image: "0103"}, set: {Z: "0"}}    `{X}` in a cell is the old cell of column X
    ..., add: {x: 0.1}    ..., times: {x: 0.01}    ..., floor: {X: 10}    ..., noise: {x: 0.02}, seed: 11
    ..., exchange: {fiducial: {"1": "2", "2": "1"}}    ..., shuffle: point, seed: 3
    ..., drop: true    ..., keep: true    ..., copy: {image: "1-2"}    rows once more, with these cells
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

Row = dict[str, str]
Tables = dict[str, str | bytes]
"""Name of the file -> its content."""
Change = Mapping[str, Any]


def apply(change: Change, tables: Tables) -> None:
    """Change the tables of a block."""
    if "points" in change:
        _rename_points(tables, change["points"])
    elif "text" in change or "bytes" in change:
        tables[change["file"]] = change["text"] if "text" in change else change["bytes"].encode("latin-1")
    elif "replace" in change:
        old = _text(tables, change["file"])
        assert change["replace"] in old, f"{change['file']} has no {change['replace']!r}"
        tables[change["file"]] = old.replace(change["replace"], change["by"] * change.get("repeat", 1), 1)
    elif "append" in change:
        tables[change["file"]] = str(tables.get(change["file"], "")) + change["append"] * change.get("repeat", 1)
    elif "before" in change:
        tables[change["file"]] = _text(tables, change["file"]).partition(change["before"])[0]
    elif "remove" in change or "link" in change:
        del tables[change["file"]]
    elif not change.keys() & {"encoding", "ends", "of_memory"}:
        _change_rows(change, tables)
    if change.keys() & {"encoding", "ends"}:
        text = _text(tables, change["file"]).replace("\n", change.get("ends", "\n"))
        tables[change["file"]] = text.encode(change.get("encoding", "utf-8"))


def _text(tables: Tables, name: str) -> str:
    text = tables[name]
    assert isinstance(text, str)
    return text


def _rename_points(tables: Tables, names: Mapping[str, str]) -> None:
    for name in ("geodetic.csv", "covariances.csv", "relative_control.yaml"):
        del tables[name]
    for name in ("image_points.csv", "ground_points.csv"):
        head, *rows = _text(tables, name).replace(",no\n", ",\n").splitlines()
        cells = [row.partition(",") for row in rows]
        tables[name] = "\n".join([head, *(names.get(point, point) + comma + rest for point, comma, rest in cells), ""])


def _change_rows(change: Change, tables: Tables) -> None:
    rows: list[Row] = list(csv.DictReader(io.StringIO(_text(tables, change["file"]))))
    chosen = [_fits(row, change.get("rows", {})) and not _fits(row, change.get("but", [])) for row in rows]
    assert any(chosen), f"no row fits {change}"
    rows = change_cells(change, rows, chosen)
    text = io.StringIO()
    writer = csv.DictWriter(
        text, list(dict.fromkeys(key for row in rows for key in row)), restval="", lineterminator="\n"
    )
    writer.writeheader()
    writer.writerows(rows)
    tables[change["file"]] = text.getvalue()


def change_cells(change: Change, rows: list[Row], chosen: list[bool]) -> list[Row]:
    """The rows of a table, the chosen ones changed."""
    some = [row for row, yes in zip(rows, chosen) if yes]
    if "drop" in change or "keep" in change:
        return [row for row, yes in zip(rows, chosen) if yes == ("keep" in change)]
    if "copy" in change:
        return rows + [row | change["copy"] for row in some]
    chance = np.random.default_rng(change.get("seed"))
    if "shuffle" in change:
        cells = [row[change["shuffle"]] for row in some]
        order = chance.permutation(len(cells))
        made = [row | {change["shuffle"]: cells[k]} for row, k in zip(some, order)]
    else:
        verb = next(verb for verb in CELLS if verb in change)
        made = [row | {key: CELLS[verb](row, key, by, chance) for key, by in change[verb].items()} for row in some]
    left = iter(made)
    return [next(left) if yes else row for row, yes in zip(rows, chosen)]


CELLS: Mapping[str, Callable[[Row, str, Any, np.random.Generator], str]] = {
    "set": lambda row, _key, by, _: by.format(**row),
    "add": lambda row, key, by, _: f"{float(row[key]) + by:.4f}",
    "times": lambda row, key, by, _: f"{float(row[key]) * by:.6f}",
    "floor": lambda row, key, by, _: f"{float(row[key]) // by * by:.0f}",
    "noise": lambda row, key, by, chance: f"{float(row[key]) + chance.normal(0, by):.4f}",
    "exchange": lambda row, key, by, _: by.get(row[key], row[key]),
}
"""A cell anew, from its row, its column, what the change says of it, and chance."""


def _fits(row: Row, patterns: Any) -> bool:
    if isinstance(patterns, list):
        return any(_fits(row, one) for one in patterns)
    wanted = {key: value if isinstance(value, list) else [value] for key, value in patterns.items()}
    return all(any(fnmatchcase(row[key], one) for one in values) for key, values in wanted.items())
