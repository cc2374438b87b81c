"""Row 40: A distortion that folds the image before its corner."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(folder, said('"k1": 2e-05', '"k1": -8e-03'), until="absolute")
    return None
