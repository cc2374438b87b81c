"""Strip adjustment of blocks that positions alone, or little more, bring to the ground."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.conformal import ConformalOptions, conformal
from aatri.stages.strip_adjustment.polynomial import PolynomialOptions, polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.made_strips import Heard, MadeBlock
from tests.stages.chain import simulated

METHODS = {"polynomial": (polynomial, PolynomialOptions), "conformal": (conformal, ConformalOptions)}


def _oriented(control, noise_m: float = 0.02):
    """Two strips with a position for every image, and a few control points."""
    made = MadeBlock(2, 5, noise_m=noise_m)
    made.control(control)
    made.positions(range(len(made.truth_X0)))
    block, points, strips = made.block(), made.image_points(), made.strips()
    return made, (block, points, strips, similarity(block, strips, points))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("control", [(), (3,), (3, 40), (3, 20, 40)])
def test_positions_and_little_or_no_control_give_a_block(name: str, control) -> None:
    made, given = _oriented(control)
    heard = Heard()
    solution = METHODS[name][0](*given, context=heard)
    assert solution.images.oriented.all()
    assert np.sqrt(np.nanmean((solution.points.xyz_m - made.truth) ** 2)) < 0.1
    assert not any("degree" in text for text in heard.warnings)  # nobody has asked for one
    if not control:
        assert np.array_equal(np.isfinite(solution.points.xyz_m), np.isfinite(given[3].points.xyz_m))
        assert any("no strip is corrected" in line for line in heard.lines)


@pytest.mark.parametrize("name", METHODS)
def test_a_degree_that_is_asked_for_and_falls_is_a_warning(name: str) -> None:
    _, given = _oriented((3,))
    method, options = METHODS[name]
    heard = Heard()
    method(*given, options=options(degree=2), context=heard)
    assert any("height" in text and "degree 2: rank" in text for text in heard.warnings)


def test_second_degree_by_control_in_a_third_of_a_strip_falls_by_the_factor_of_its_design() -> None:
    """Corrections a1 + aU U + aV V + aUU U^2 + aUV U V of all points over a single point's: sqrt(mean d'Q d)."""
    made, heard = MadeBlock(1, 12), Heard()
    near = np.flatnonzero(made.truth[:, 0] < made.truth[0, 0] + 800.0)
    made.control(near[[0, 3, 9, 16, 21, -1]].tolist(), sigma_m=0.02)
    block, points, strips = made.block(), made.image_points(), made.strips()
    start = similarity(block, strips, points)
    solution = polynomial(block, points, strips, start, context=heard)
    value = dict(zip(solution.transformations.parameter.tolist(), solution.transformations.value.tolist()))
    d = start.points.xyz_m - [value[f"origin_{axis}_m"] for axis in "XYZ"]
    sin, cos = np.sin(value["azimuth_of_U_rad"]), np.cos(value["azimuth_of_U_rad"])
    U = (d[:, 0] * sin + d[:, 1] * cos) / value["half_range_U_m"]
    V = (d[:, 1] * sin - d[:, 0] * cos) / value["half_range_V_m"]
    D = np.column_stack([np.ones_like(U), U, V, U * U, U * V])
    D, of_control = D[np.isfinite(U)], D[sorted(made.given)]
    Q = np.linalg.inv(of_control.T @ of_control)
    factor = np.sqrt(np.mean(np.einsum("ni,ij,nj->n", D, Q, D)))
    assert factor > 5
    told = [line for line in heard.lines if "less precise" in line]
    assert [f"corrections {factor:.1f} times" in line for line in told] == [True, True]  # plan, and height


@pytest.mark.slow
def test_long_strips_of_a_block_without_gross_errors_lose_no_control_and_no_tie() -> None:
    """What strips of forty models are deformed by is no gross error of the control that they do not reach."""
    block, heard = simulated(1, preset="uav", flight={"strips": 30, "images_per_strip": 40, "cross_strips": 0}), Heard()
    points = systematic(block, calibrated(block))
    models = dependent(block, points)
    strips = scale_transfer(block, models)
    solution = polynomial(block, points, strips, similarity(block, strips, points), context=heard)
    assert not solution.suspects.staying_out.any()
    assert not [line for line in heard.warnings if "above the limit" in line or "rejected" in line]
