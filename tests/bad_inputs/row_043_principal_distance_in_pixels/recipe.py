"""Row 43: The principal distance in pixels where millimetres belong."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(folder, said("principal_distance: 8.8", "principal_distance: 3667"), until="absolute")
    return None
