"""Control and positions that are given far more exact than image points can tell."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.small_blocks import C_MM, HEIGHT_M, SIGMA_MM, adjusted_by, flown

ON_GROUND_M = SIGMA_MM / C_MM * HEIGHT_M
"""15 mm: what an image point measures."""


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("kind", "times", "told"), [("control", 200, 1), ("control", 50, 0), ("position", 200, 1)])
def test_what_images_cannot_check_is_told(tmp_path: Path, kind: str, times: float, told: int) -> None:
    """Errors of the size that image points have, given as so many times smaller: a block may follow them."""
    small = flown(strips=2, per_strip=4)
    small.observed = small.observed if kind == "position" else {}
    small.control = small.control if kind == "control" else {}
    folder = small.write(tmp_path / "block")
    given, sigma_m = ("0.05", "exterior.csv") if kind == "position" else ("0.02", "block.yaml"), ON_GROUND_M / times
    text = (folder / given[1]).read_text()
    (folder / given[1]).write_text(
        text.replace(f"- {given[0]}\n", f"- {sigma_m}\n").replace(f",{given[0]}", f",{sigma_m}")
    )
    done = adjusted_by("default", folder, blunders={"sigmas": "given"})
    named = [text for text in done.warnings if "no test sees them" in text]
    assert len(named) == told
    ratio = [float(text.split(" on the ground, ")[1].split()[0]) for text in named if kind in text]
    assert ratio == pytest.approx([times] * told, rel=0.1)
