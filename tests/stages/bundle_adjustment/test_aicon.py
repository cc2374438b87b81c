"""The parameters of AICON's set are those of the image error at the projection, however large the distortion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.additional_parameters import additional_parameters
from tests.stages.bundle_adjustment.test_given_in_part import cells, exterior
from tests.stages.hand_block import C_MM, ground_rows, hand, read, start

A1, R0 = 2e-7, 70.0


@pytest.mark.parametrize("radius", [R0, None])
def test_the_coefficients_of_a_strong_lens_are_found(radius: float | None, tmp_path: Path) -> None:
    """0.3 mm at the edge: at measured coordinates A1 would come out 1 % too small, and so for its radius."""
    of = hand()
    r0 = 2 / 3 * np.hypot(115.0, 115.0) if radius is None else radius
    r2 = (of.xy_mm**2).sum(axis=1, keepdims=True)
    error = of.xy_mm * (A1 * (r2 - r0**2) + 0.03 / C_MM) + [0.02, -0.01]
    assert np.abs(error).max() > 0.2
    rows = [cells(of, k) | dict.fromkeys(("sX", "sY", "sZ"), 0.001) for k in range(6)]
    block, points = read(
        tmp_path,
        of,
        ground=ground_rows(of, range(30), ",0.001,0.001,0.001", ",sX,sY,sZ"),
        exterior=exterior(rows),
        xy_mm=of.xy_mm + error,
    )
    wanted = {"set": "aicon", "sigma_um": None} | ({} if radius is None else {"balance_radius_mm": radius})
    options = BundleOptions(blunders="none", tolerance=1e-6, self_calibration=wanted)
    found = bundle(block, points, start(of, block), options=options)
    value = dict(zip(found.parameters.name.tolist(), found.parameters.value.tolist()))
    assert value["A1"] == pytest.approx(A1, rel=2e-4)
    assert [value["c"], value["x0"], value["y0"]] == pytest.approx([0.03, 0.02, -0.01], abs=2e-4)
    assert found.cameras.principal_distance_mm[0] == pytest.approx(C_MM + 0.03, abs=2e-4)
    corrected = additional_parameters(block, points, found).measurements.xy_mm
    np.testing.assert_allclose(corrected, of.xy_mm, atol=2e-4)
