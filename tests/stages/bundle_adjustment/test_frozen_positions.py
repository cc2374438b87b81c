"""A receiver that stands still: the last position goes into the rows of the images that follow."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.small_blocks import adjusted_by, flown, off_m


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wrong_positions_are_rejected_and_no_image_is_lost_with_them(tmp_path: Path, seed: int) -> None:
    """With three rejected positions taken back four images begin in one place, and least squares set them aside."""
    small = flown(strips=3, per_strip=6, seed=seed, points=14, apart_m=600.0)
    folder = small.write(tmp_path / "block")
    rows = [line.split(",") for line in (folder / "exterior.csv").read_text().splitlines()]
    place = next(row[1:4] for row in rows if row[0] == "301")
    for row in rows:
        row[1:4] = place if row[0] in ("302", "303", "304") else row[1:4]
    (folder / "exterior.csv").write_text("\n".join(",".join(row) for row in [*rows, [""]]))
    done = adjusted_by("graph", folder)
    assert done.bundle.images.oriented.all()
    assert off_m(small, done.bundle) < 0.5
    s = done.bundle.suspects
    assert set(s.image[(s.kind == "position") & s.staying_out].tolist()) == {"302", "303", "304"}
