"""Interior orientations as they are told: absolute, with covariances, in the convention of the camera."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.formats.results.solution_tables import write_solution_tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.bundle_adjustment.test_given_in_part import cells, exterior
from tests.stages.hand_block import C_MM, PRINCIPAL_POINT_MM, Hand, ground_rows, hand, read, start

TRUE = np.array([C_MM + 0.05, *(PRINCIPAL_POINT_MM + np.array([0.03, -0.04]))])
"""What the block, whose rays were made with C_MM, has if its nominal camera is off by the difference."""


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


@pytest.mark.parametrize("way", ["model", "set"])
def test_an_interior_orientation_is_told_as_adjusted(of: Hand, way: str, tmp_path: Path) -> None:
    """The rays are those of a camera whose c and principal point are others than the block says."""
    rows = [cells(of, k) | dict.fromkeys(("sX", "sY", "sZ"), 0.001) for k in range(6)]
    seen = of.xy_mm * TRUE[0] / C_MM + TRUE[1:] - PRINCIPAL_POINT_MM
    sigmas = {"principal_distance": float("inf"), "principal_point": [float("inf"), 0.5]}
    camera = {"sigmas": sigmas} if way == "model" else {}
    block, points = read(
        tmp_path / "b", of, ground=ground_rows(of, range(30)), exterior=exterior(rows), xy_mm=seen, camera=camera
    )
    options = {} if way == "model" else {"self_calibration": {"set": "brown_conrady"}}
    found = bundle(block, points, start(of, block), options=BundleOptions(blunders="none", tolerance=1e-6, **options))
    np.testing.assert_allclose(found.cameras.principal_distance_mm, TRUE[:1], atol=3e-4)
    np.testing.assert_allclose(found.cameras.principal_point_mm[0], TRUE[1:], atol=3e-4)
    if way == "model":
        p = dict(zip(found.parameters.name.tolist(), found.parameters.value.tolist()))
        np.testing.assert_allclose([p["principal_point.x"], p["principal_point.y"]], TRUE[1:], atol=3e-4)
        again = replace(block, cameras=replace(block.cameras, principal_point_mm=np.array([[0.0, 0.5]])))
        at_zero = replace(points, measurements=replace(points.measurements, xy_mm=seen + PRINCIPAL_POINT_MM - [0, 0.5]))
        same = bundle(again, at_zero, start(of, block), found, options=BundleOptions(blunders="none", tolerance=1e-6))
        np.testing.assert_allclose(same.cameras.principal_point_mm[0], TRUE[1:], atol=3e-4)
    write_solution_tables(found, block, tmp_path / "out")
    (row,) = csv.DictReader((tmp_path / "out" / "cameras.csv").read_text().splitlines())
    assert float(row["principal_point_x_mm"]) == found.cameras.principal_point_mm[0, 0]
    names = ("c", "x0", "y0") if way == "set" else ("principal_distance", "principal_point.x", "principal_point.y")
    sigma = dict(zip(found.parameters.name.tolist(), found.parameters.sigma.tolist()))
    for column, name in zip(("principal_distance", "principal_point_x", "principal_point_y"), names):
        assert float(row[f"s{column}_mm"]) == pytest.approx(sigma[name], rel=2e-3)
    cofactor = float(row["covariance_principal_point_x_principal_point_y_mm2"])
    assert abs(cofactor) < sigma[names[1]] * sigma[names[2]]
    assert row["convention"].startswith("principal point from the fiducial centre, x right, y up")
