"""What a block leaves open is set aside by name, and the rest is adjusted as it would be without it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.errors import ArtifactError, GeometryError
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.small_blocks import Small, Told, adjusted_by, flown, measure, off_m, two_apart


def adjusted(small: Small, folder: Path, initial: Solution, method: str) -> tuple[Solution, list[str]]:
    told = Told()
    block = tables(options=TablesOptions(path=small.write(folder)))
    done = bundle(block, calibrated(block), initial, options=BundleOptions(blunders={"method": method}), context=told)
    return done, told.warnings


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("method", ["none", "robust_snooping"])
def test_an_image_whose_points_lie_on_a_line_is_set_aside(tmp_path: Path, method: str) -> None:
    small = flown(2, 4)
    small.observed = {}
    small.xyz_m |= {f"l{k}": np.array([800.0, 400.0 + 90.0 * k, 20.0]) for k in range(3)}
    measure(small, np.random.default_rng(3))
    initial = adjusted_by("graph", small.write(tmp_path / "whole")).initial
    for point in small.seen_by("204"):
        if not point.startswith("l") and sum((image, point) in small.rays for image in small.strip) > 1:
            del small.rays["204", point]
    done, warnings = adjusted(small, tmp_path / "block", initial, method)
    assert done.images.id[~done.images.oriented].tolist() == ["204"]
    assert any("set aside" in line and "image 204" in line for line in warnings)
    small.without_rays("204")
    bare, _ = adjusted(small, tmp_path / "bare", _of_others(initial, small), method)
    some = bare.images.oriented
    np.testing.assert_allclose(done.images.position_m[some], bare.images.position_m[some], atol=1e-4)
    assert off_m(small, done) < 0.2


def _of_others(initial: Solution, small: Small) -> Solution:
    """Start values of the points that are left in the block."""
    left = np.isin(initial.points.id, sorted({p for _, p in small.rays} | set(small.control)))
    return replace(initial, points=initial.points.take(np.flatnonzero(left)))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["none", "robust_snooping"])
def test_a_part_without_a_datum_is_set_aside_whatever_its_size(tmp_path: Path, method: str) -> None:
    small = two_apart(strips=2, per_strip=3)
    initial = adjusted_by("graph", small.write(tmp_path / "whole")).initial
    small.observed = {}
    small.control = {name: axes for name, axes in small.control.items() if not name.startswith("B")}
    small.control |= {"BC1": "XYZ"}
    done, warnings = adjusted(small, tmp_path / "block", initial, method)
    assert done.images.id[done.images.oriented].tolist() == ["101", "102", "103", "201", "202", "203"]
    assert any("set aside" in line and "image B101" in line for line in warnings)
    assert off_m(small, done) < 0.3
    small.control = {"C1": "XYZ", "BC1": "XYZ"}
    with pytest.raises(GeometryError, match="unknown"):
        adjusted(small, tmp_path / "open", initial, method)


def test_a_start_of_other_points_is_refused(tmp_path: Path) -> None:
    small = flown(2, 3)
    initial = adjusted_by("graph", small.write(tmp_path / "whole")).initial
    for image in [image for image, point in small.rays if point == "p10"]:
        del small.rays[image, "p10"]
    with pytest.raises(ArtifactError, match="its points differ"):
        adjusted(small, tmp_path / "block", initial, "none")
