"""Row 39: A distortion of the wrong sign and size: 1e-3 instead of 2e-5."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(folder, said('"k1": 2e-05', '"k1": 1e-03'), until="absolute")
    return None
