"""Row 38: The principal point counted from the corner of the image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(folder, said("principal_point: [0.012, -0.008]", "principal_point: [6.578, 4.370]"), until="absolute")
    return None
