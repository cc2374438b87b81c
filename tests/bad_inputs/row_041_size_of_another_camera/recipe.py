"""Row 41: The format of a smaller camera: pixels lie outside."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(folder, said("format: [5472.0, 3648.0]", "format: [3648.0, 5472.0]"), until="absolute")
    return None
