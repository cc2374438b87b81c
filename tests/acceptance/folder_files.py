"""A block folder as settings and tables, and its files: those that differ from what is there are written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tests.stages.hand_block import Hand

Table = list[dict[str, Any]]


@dataclass
class Folder:
    """A block folder before it is written."""

    of: Hand
    settings: dict[str, Any]
    tables: dict[str, Table]
    conditions: Table

    def parts(self) -> dict[str, Any]:
        """What the files hold, by their names."""
        files = {"block.yaml": self.settings, **{f"{name}.csv": rows for name, rows in self.tables.items()}}
        return files | ({"relative_control.yaml": self.conditions} if self.conditions else {})

    def write(self, folder: Path) -> None:
        """Write block.yaml, the tables and relative_control.yaml, but for those that are there as they are."""
        folder.mkdir(parents=True, exist_ok=True)
        before, parts = WRITTEN.get(folder, {}), self.parts()
        for name, part in parts.items():
            if before.get(name) != part:
                (folder / name).write_text(_yaml(part) if name.endswith(".yaml") else _csv(part))
        WRITTEN[folder] = parts


WRITTEN: dict[Path, dict[str, Any]] = {}
"""What the files of folders hold; parts are never changed in place."""


def _csv(rows: Table) -> str:
    columns = list(dict.fromkeys(column for row in rows for column in row))
    lines = [",".join(str(row.get(column, "")) for column in columns) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def _yaml(value: Any) -> str:
    """Without anchors: what stands twice is written twice."""
    return yaml.dump(value, Dumper=_Plain, sort_keys=False)


class _Plain(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True
