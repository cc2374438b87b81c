"""Row 21: An id beyond 64 bits is text like any other."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import renamed


def make(folder: Path) -> list[str] | None:
    renamed(folder, {"K": str(2**70)})
    return None
