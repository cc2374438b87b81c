"""Row 46: The calibration of another lens, 2 per cent off, held against an adjusted one."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(
        folder,
        said("principal_distance: 8.8", "principal_distance: 8.97"),
        said("sigmas: {}", "sigmas: {principal_distance: 0.005}"),
        refined="distortion: false",
    )
    return None
