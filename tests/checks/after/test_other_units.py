"""One distance beside control in feet: it is rejected, and the unit is told that would make both fit."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.small_blocks import adjusted_by, flown


@pytest.mark.parametrize(("off", "unit"), [(1.0, "feet"), (1.5, "")])
def test_a_distance_that_control_in_feet_contradicts_names_the_unit(tmp_path: Path, off: float, unit: str) -> None:
    small = flown(strips=2, per_strip=4)
    small.observed = {}
    often = Counter(point for _, point in small.rays if point not in small.control)
    a, b = (point for point, _ in often.most_common(2))
    value = off * float(np.linalg.norm(small.xyz_m[a] - small.xyz_m[b]))
    small.relative = [{"type": "distance", "points": [a, b], "value": value, "sigma": 0.02}]
    folder = small.write(tmp_path / "block")
    head, *rows = (folder / "ground_points.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    feet = [",".join([name, *(repr(float(x) / 0.3048) for x in xyz)]) for name, *xyz in cells]
    (folder / "ground_points.csv").write_text("\n".join([head, *feet, ""]))
    done = adjusted_by("graph", folder)
    named = [text for text in done.warnings if "are in another unit" in text]
    assert [("feet" in text, "0.3048" in text, f"{a}-{b}" in text) for text in named] == [(True,) * 3] * bool(unit)
