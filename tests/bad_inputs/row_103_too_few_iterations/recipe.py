"""Row 103: A bundle that may not take the iterations it needs."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film


def make(folder: Path) -> list[str] | None:
    film(folder, bundle="max_iterations: 1")
    return None
