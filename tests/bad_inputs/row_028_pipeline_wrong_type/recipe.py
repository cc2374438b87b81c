"""Row 28: A text where a number is wanted."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import pipeline


def make(folder: Path) -> list[str] | None:
    pipeline(folder, "  block: {use: block/bal, with: {path: p, image_sigma_px: one}}\n")
    return None
