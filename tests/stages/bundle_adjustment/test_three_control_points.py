"""Three control points of which one is wrong: without any of them the datum is open, and nothing tells which it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import GeometryError
from tests.small_blocks import Small, adjusted_by, flown

THREE = ("C1", "C2", "C4")


def with_wrong_control(off_m: float, direction: tuple[float, float, float] = (0.6, -0.5, 0.6)) -> Small:
    small = flown(2, 5, points=20)
    small.control, small.observed = dict.fromkeys(THREE, "XYZ"), {}
    small.xyz_m["C2"] = small.xyz_m["C2"] + off_m * np.array(direction)
    return small


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("chain", ["graph", "chain"])
def test_all_are_used_as_uncertain_as_they_differ_and_no_image_point_goes(tmp_path: Path, chain: str) -> None:
    small = with_wrong_control(0.5)
    done = adjusted_by(chain, small.write(tmp_path / "b"))
    (text,) = (warning for warning in done.warnings if "one of these is wrong" in warning)
    assert text.startswith("control: one of these is wrong, and nothing tells which")
    assert text.endswith(": C1, C2, C4")
    assert not [warning for warning in done.warnings if warning.startswith("image_point") or "and kept" in warning]
    assert 0.9 < done.bundle.sigma0 < 1.1
    row = {name: k for k, name in enumerate(done.block.points.id.tolist())}
    new = [name for name in small.xyz_m if name not in THREE and name in row]
    d = done.bundle.points.xyz_m[[row[p] for p in new]] - np.array([small.xyz_m[p] for p in new])
    C = done.bundle.points.covariance_m2[[row[p] for p in new]]
    square = np.einsum("ni,ni->n", d, np.linalg.solve(C, d[..., None])[..., 0])
    assert np.nanmean(square) / 3 < 3.0  # one error of 0.5 m, of which all standard deviations know


def test_the_same_is_said_whatever_the_start(tmp_path: Path) -> None:
    small = with_wrong_control(0.5)
    texts = [
        [w for w in adjusted_by(chain, small.write(tmp_path / chain)).warnings if "one of these is wrong" in w]
        for chain in ("graph", "chain")
    ]
    assert texts[0] == texts[1]


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_none_is_blamed_whichever_coordinate_is_wrong(tmp_path: Path, direction: tuple[float, float, float]) -> None:
    done = adjusted_by("graph", with_wrong_control(0.5, direction).write(tmp_path / "b"))
    of_control = [warning for warning in done.warnings if warning.startswith("control")]
    assert all(all(name in warning for name in THREE) for warning in of_control), of_control
    assert not [warning for warning in done.warnings if "standard deviations do not fit" in warning]


def test_what_is_off_by_a_tenth_of_the_block_is_refused_with_the_distances(tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match="contradicts itself") as error:
        adjusted_by("graph", with_wrong_control(100.0).write(tmp_path / "b"))
    assert all(f"point {name}" in error.value.what for name in THREE)
