"""Row 113: Standard deviations asked for where the memory does not hold them."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film


def make(folder: Path) -> list[str] | None:
    film(folder, bundle="memory_gb: 1.0e-6")
    return None
