"""Row 100: All parameters of the camera named and fixed."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said


def make(folder: Path) -> list[str] | None:
    digital(
        folder,
        said(
            "sigmas: {}",
            "sigmas: {principal_distance: 0, principal_point: [0, 0], k1: 0, k2: 0, k3: 0, p1: 0, p2: 0, b1: 0, b2: 0}",
        ),
    )
    return None
