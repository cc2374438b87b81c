"""The rows of the tables of bad inputs: a base block, what is changed in it, and what aatri must say of it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent
from typing import Any

import yaml

from tests.bad_inputs.bases import pipeline_of, tables_of, without_single_points
from tests.bad_inputs.changes import apply

HERE = Path(__file__).parent
FILES = sorted(HERE.glob("*.yaml"))
KEYS = {
    "id",
    "what",
    "otherwise",
    "base",
    "stations",
    "points",
    "control",
    "positions",
    "changes",
    "folder",
    "path",
    "stages",
    "until",
    "with",
    "gates",
    "shows",
    "masked",
    "slow",
    "exit",
    "says",
}


@dataclass(frozen=True)
class BadInput:
    """A row, and the file it stands in."""

    file: Path
    row: Mapping[str, Any]

    @property
    def id(self) -> str:
        return str(self.row["id"])

    @property
    def is_computed(self) -> bool:
        """Whether the message has figures that are computed."""
        return bool(self.row.get("base", "tables") != "tables")

    @property
    def approved(self) -> str:
        """Exit code and message."""
        return f"exit {self.row['exit']}\n{self.row['says']}"

    def write(self, folder: Path) -> list[str]:
        """Write the project; the arguments of the command."""
        row, base = self.row, self.row.get("base", "tables")
        tables = tables_of(base, row)
        for change in row.get("changes", ()):
            apply(change, tables)
        if base == "normal_case":
            tables["image_points.csv"] = without_single_points(str(tables["image_points.csv"]))
        place = folder / row.get("folder", ".")
        (place / "block").mkdir(parents=True)
        for name, content in tables.items():
            (place / "block" / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        for change in row.get("changes", ()):
            if "link" in change:
                (place / "block" / change["file"]).symlink_to(change["link"])
            if "of_memory" in change:
                memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
                os.truncate(place / "block" / change["file"], int(change["of_memory"] * memory))
        until = row.get("until", "block" if base == "tables" else "bundle")
        stages = indent(row["stages"], "  ") if "stages" in row else pipeline_of(base, until, row.get("with", {}))
        gates = f"gates: {row['gates']}\n" if "gates" in row else ""
        stages = stages.replace("path: block", f"path: {row.get('path', 'block')}")
        (place / "pipeline.yaml").write_text(f"run: out\nseed: 1\nstages:\n{stages}{gates}", encoding="utf-8")
        return ["run", "-q", *([str(place / "pipeline.yaml")] if "folder" in row else [])]

    def approve(self, told: str) -> None:
        """Write what is told into the table, in the place of what was approved."""
        first, _, says = told.partition("\n")
        lines = "".join(f"    {line}\n" if line else "\n" for line in says.splitlines())
        answer = f"  exit: {first.removeprefix('exit ')}\n  says: " + (f"|\n{lines}" if says else '""\n')
        parts = re.split(r"(?m)^(?=- id: )", self.file.read_text(encoding="utf-8"))
        at = next(k for k, part in enumerate(parts) if part.startswith(f"- id: {self.id}\n"))
        parts[at] = parts[at].partition("  exit: ")[0] + answer + ("\n" if at < len(parts) - 1 else "")
        self.file.write_text("".join(parts), encoding="utf-8")


def all_rows() -> list[BadInput]:
    """Every row of every table."""
    return [BadInput(file, row) for file in FILES for row in yaml.safe_load(file.read_text(encoding="utf-8"))]
