"""Row 31: An image with fewer fiducials than the model needs."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(
        folder,
        replaced("fiducials.csv", "a1,2,4.1,4.3,3\na1,3,4.1,216.2,\n", ""),
        stages="  interior: {use: interior_orientation/affine, from: {block}}\n",
    )
    return None
