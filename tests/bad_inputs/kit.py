"""What the recipes of bad inputs are made of: a small block folder with changes, and a pipeline that reads it."""

from __future__ import annotations

from pathlib import Path

from tests.formats.tables.block_folder import FILES, replaced, write_folder

__all__ = ["FILES", "added", "block", "pipeline", "renamed", "replaced"]

Change = dict[str, str | bytes | None]


def block(folder: Path, *changes: Change, stages: str = "") -> None:
    """Write a project: the folder `block` with changes, and a pipeline that reads it."""
    merged: Change = {}
    for change in changes:
        merged |= change
    write_folder(folder / "block", merged)
    pipeline(folder, "  block: {use: block/tables, with: {path: block}}\n" + stages)


def pipeline(folder: Path, stages: str, head: str = "run: out\nseed: 1\n") -> None:
    """Write pipeline.yaml."""
    (folder / "pipeline.yaml").write_text(f"{head}stages:\n{stages}", encoding="utf-8")


def renamed(folder: Path, names: dict[str, str]) -> None:
    """The project with other ids of points, without geodetic observations and relative control."""
    change: Change = dict.fromkeys(("geodetic.csv", "covariances.csv", "relative_control.yaml"))
    for name in ("image_points.csv", "ground_points.csv"):
        head, *rows = FILES[name].replace(",no\n", ",\n").splitlines()
        cells = [row.partition(",") for row in rows]
        change[name] = "\n".join([head, *(names.get(point, point) + comma + rest for point, comma, rest in cells), ""])
    block(folder, change)


def added(name: str, rows: str) -> Change:
    """The change of one file that gets more rows."""
    return {name: FILES[name] + rows}
