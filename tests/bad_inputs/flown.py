"""Recipes that take more than the tables: two small flown blocks, whose tables are changed, and the stages to run.

`blocks/film` is simulated: two strips of four film images at 1 : 2500, c = 153.84 mm, 40 new points, 8 control and 3
check points, noise 5 um, positions with 5 cm. `blocks/digital`: three strips of five images of 20 megapixels from
100 m, 80 new points, 8 control and 4 check points, positions with 3 cm, no relief to speak of.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path

from tests.bad_inputs.kit import pipeline

BLOCKS = Path(__file__).parent / "blocks"

Row = dict[str, str]
Tables = dict[str, str]
Edit = Callable[[Tables], None]
"""A change of the tables: name of the file -> its text."""

STAGES = {
    "interior": "use: interior_orientation/{interior}, from: {{block}}",
    "refined": "use: image_refinement/systematic, from: {{block, image_points: interior}}",
    "models": "use: relative_orientation/dependent, from: {{block, image_points: refined}}",
    "strips": "use: strip_formation/scale_transfer, from: {{block, models}}",
    "absolute": "use: absolute_orientation/similarity, from: {{block, strips, image_points: refined}}",
    "strip_block": "use: strip_adjustment/polynomial, "
    "from: {{block, image_points: refined, strips, models, initial: absolute}}",
    "bundle": "use: bundle_adjustment/bundle, from: {{block, image_points: refined, initial: absolute}}",
    "accuracy": "use: accuracy/evaluation, from: {{block, solution: bundle}}",
}


def film(folder: Path, *edits: Edit, until: str = "bundle", **options: str) -> None:
    """The film block with changes, and a pipeline as far as a stage; options of stages as YAML."""
    _flown(folder, "film", edits, until, options)


def digital(folder: Path, *edits: Edit, until: str = "bundle", **options: str) -> None:
    """The digital block with changes, and a pipeline as far as a stage."""
    _flown(folder, "digital", edits, until, options)


def _flown(folder: Path, name: str, edits: tuple[Edit, ...], until: str, options: dict[str, str]) -> None:
    tables = {path.name: path.read_text() for path in sorted((BLOCKS / name).iterdir())}
    for edit in edits:
        edit(tables)
    (folder / "block").mkdir()
    for file, text in tables.items():
        (folder / "block" / file).write_text(text)
    lines = [f"  block: {{use: block/tables, with: {{path: block{_more(options, 'block')}}}}}"]
    names = list(STAGES)
    passed = names[: names.index(until) + 1] if until != "block" else []
    for stage in passed:
        if stage == "strip_block" != until:
            continue
        body = STAGES[stage].format(interior="affine" if name == "film" else "calibrated")
        given = f", with: {{{options[stage]}}}" if stage in options else ""
        lines.append(f"  {stage}: {{{body}{given}}}")
    pipeline(folder, "\n".join([*lines, ""]))


def _more(options: dict[str, str], stage: str) -> str:
    return f", {options[stage]}" if stage in options else ""


def each(name: str, change: Callable[[Row], Row | None]) -> Edit:
    """Change a table row by row; None takes the row out, new columns are added."""

    def edit(tables: Tables) -> None:
        rows = [new for row in csv.DictReader(io.StringIO(tables[name])) if (new := change(row)) is not None]
        columns = list(dict.fromkeys(column for row in rows for column in row))
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        tables[name] = text.getvalue()

    return edit


def moved(name: str, of: Callable[[Row], bool], **by: float) -> Edit:
    """Add to numbers of some rows of a table."""

    def change(row: Row) -> Row:
        return row | {column: f"{float(row[column]) + d:.4f}" for column, d in by.items()} if of(row) else row

    return each(name, change)


def scaled(name: str, of: Callable[[Row], bool], **by: float) -> Edit:
    """Multiply numbers of some rows of a table."""

    def change(row: Row) -> Row:
        return row | {column: f"{float(row[column]) * f:.6f}" for column, f in by.items()} if of(row) else row

    return each(name, change)


def more(name: str, rows: str) -> Edit:
    """Add rows to a table, or a table that was not there."""

    def edit(tables: Tables) -> None:
        tables[name] = tables.get(name, "") + rows

    return edit


def without(name: str) -> Edit:
    """Take a table away."""

    def edit(tables: Tables) -> None:
        del tables[name]

    return edit


def said(old: str, new: str) -> Edit:
    """Replace a text in block.yaml."""

    def edit(tables: Tables) -> None:
        assert old in tables["block.yaml"]
        tables["block.yaml"] = tables["block.yaml"].replace(old, new)

    return edit


def is_control(row: Row) -> bool:
    """Whether a row of the ground points is a control point."""
    return row["role"] == "control"


def every(_: Row) -> bool:
    """All rows."""
    return True
