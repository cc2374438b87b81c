"""Row 99: A radial distortion that the block does not know: the model bends."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said, without


def make(folder: Path) -> list[str] | None:
    digital(
        folder,
        said('"k1": 2e-05', '"k1": -8e-05'),
        without("exterior.csv"),
        until="accuracy",
        refined="refraction: false, earth_curvature: false",
    )
    return None
