"""Row 105: What a failed bundle leaves: no result that anything below would take."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film


def make(folder: Path) -> list[str] | None:
    film(folder, bundle="max_iterations: 1", until="accuracy")
    return None
