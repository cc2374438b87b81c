"""Row 20: Ids 007, 1e5, NO and .5 stay what they are."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import renamed


def make(folder: Path) -> list[str] | None:
    renamed(folder, {"K": ".5", "2": "1e5", "3": "NO"})
    return None
