"""Row 24: Blanks, slashes, markup and signs in ids: read."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import renamed


def make(folder: Path) -> list[str] | None:
    renamed(folder, {"K": '"<script>, a/b=1"'})
    return None
