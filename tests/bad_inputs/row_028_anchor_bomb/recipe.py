"""Row 28: Anchors and aliases."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"block.yaml": "a: &a [x, x]\nb: &b [*a, *a]\n"})
    return None
