"""A rejected distance that fits in another unit is told with that unit, which may be its own or that of the control."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.checks.after.left_out import OTHER_UNITS, lengths_in_other_units
from aatri.geometry.similarity import IDENTITY
from aatri.orientation.bodies.free_body import state_of
from aatri.units import FOOT_M
from tests.orientation.bodies.made_body import MadeBody
from tests.small_blocks import Small, adjusted_by, flown


def two_strips() -> tuple[Small, str, str]:
    """Two strips with control and no positions, and their two tie points with the most rays."""
    small = flown(strips=2, per_strip=4)
    small.observed = {}
    often = Counter(point for _, point in small.rays if point not in small.control)
    a, b = (point for point, _ in often.most_common(2))
    return small, a, b


def told(folder: Path, pair: str) -> list[tuple[str, str]]:
    """Unit and factor that the block of a folder is told of this pair."""
    texts = [text for text in adjusted_by("graph", folder).warnings if "are in another unit" in text]
    assert all(text.startswith("relative_distance: ") and pair in text for text in texts)
    return [(text.split("another unit (")[1].split(")")[0], text.split(" times")[0].split()[-1]) for text in texts]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("off", "units"), [(1.0, [("feet", "0.3048")]), (1.5, [])])
def test_a_distance_that_control_in_feet_contradicts_names_the_unit(
    tmp_path: Path, off: float, units: list[tuple[str, str]]
) -> None:
    small, a, b = two_strips()
    value = off * float(np.linalg.norm(small.xyz_m[a] - small.xyz_m[b]))
    small.relative = [{"type": "distance", "points": [a, b], "value": value, "sigma": 0.02}]
    folder = small.write(tmp_path / "block")
    head, *rows = (folder / "ground_points.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    feet = [",".join([name, *(repr(float(x) / FOOT_M) for x in xyz)]) for name, *xyz in cells]
    (folder / "ground_points.csv").write_text("\n".join([head, *feet, ""]))
    assert told(folder, f"{a}-{b}") == units


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("between", ["points", "images"])
@pytest.mark.parametrize(("factor", "unit"), OTHER_UNITS.items())
def test_a_distance_in_another_unit_than_control_names_it(
    tmp_path: Path, between: str, factor: float, unit: str
) -> None:
    small, a, b = two_strips()
    places = small.xyz_m if between == "points" else small.position_m
    a, b = (a, b) if between == "points" else ("101", "104")
    value = factor * float(np.linalg.norm(places[a] - places[b]))
    small.relative = [{"type": "distance", between: [a, b], "value": value, "sigma": 0.02 * factor}]
    assert told(small.write(tmp_path / "block"), f"{a}-{b}") == [(unit, f"{factor:.4g}")]


def test_ends_that_coincide_are_in_no_unit(recwarn: pytest.WarningsRecorder) -> None:
    """A length of 0 m in the block, given as 5 m."""
    body = MadeBody(np.zeros((2, 3))).distances([0], [1], 0.02, np.array([5.0]))
    (observed,) = body.observed
    rejected = AdjustedObservations(observed, np.array([0]), np.array([False]), np.zeros((1, 1, 1)))
    state = state_of(body.observed, body.body, IDENTITY)
    result = SimpleNamespace(adjusted=SimpleNamespace(state=state), observations=(rejected,))
    assert lengths_in_other_units(result) == []  # type: ignore[arg-type]
    assert not recwarn.list
