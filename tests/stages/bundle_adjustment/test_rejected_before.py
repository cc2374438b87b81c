"""What a stage before has rejected stays out of the bundle, of every kind, unless it fits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.adapters.bundle.bundle_input import rays_of_rejected_ties
from aatri.errors import ConvergenceError
from aatri.stages.bundle_adjustment import _adjusted
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.affine import affine
from tests.stages.bundle_adjustment.test_bundle_input import (
    CORNERS,
    NO_SEARCH,
    OF,
    assert_is_the_block,
    exterior_rows,
    rows_of,
)
from tests.stages.chain import simulated
from tests.stages.hand_block import (
    Heard,
    angles_deg,
    ground_rows,
    projected,
    read,
    start,
    suspected,
)


def test_what_was_rejected_stays_out_and_what_was_not_does_not(tmp_path: Path) -> None:
    measured = OF.xy_mm.copy()
    row = int(np.flatnonzero((OF.image == 1) & (OF.point == 14))[0])
    measured[row] += [0.2, -0.3]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    found = bundle(block, points, start(OF, block, suspected("image_point", [row])))
    assert_is_the_block(found, OF)
    assert row not in found.residuals.row[rows_of(found, "image_point")]
    assert found.suspects.verdict.tolist() == ["rejected"]
    assert found.observations == 2 * (len(OF.image) - 1) + 12
    for verdict in ("kept", "readmitted"):
        taken = bundle(block, points, start(OF, block, suspected("image_point", [row], verdict)), options=NO_SEARCH)
        assert row in taken.residuals.row[rows_of(taken, "image_point")]
        assert taken.sigma0 > 2


def test_a_right_observation_that_was_rejected_comes_back_alone(tmp_path: Path) -> None:
    measured = OF.xy_mm.copy()
    wrong, right = 7, 40
    measured[wrong] += [0.0, 1.0]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    heard = Heard()
    found = bundle(block, points, start(OF, block, suspected("image_point", [wrong, right])), context=heard)
    assert found.suspects.verdict.tolist() == ["rejected", "readmitted"]
    used = found.residuals.row[rows_of(found, "image_point")]
    assert right in used
    assert wrong not in used
    assert_is_the_block(found, OF)


def test_rays_of_a_strip_tie_that_was_rejected_stay_out_unless_they_fit(tmp_path: Path) -> None:
    """Here they do: nothing is wrong with the tie."""
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=OF.xy_mm)
    second = str(block.strips.id[block.images.strip[4]])
    tie = replace(suspected("strip_tie", [-1]), image=np.array([second]), point=np.array(["p14"]))
    rows = np.flatnonzero((OF.image > 2) & (OF.point == 14))
    assert rays_of_rejected_ties(block, points, tie) == {("image_point", row) for row in rows.tolist()}
    assert not rays_of_rejected_ties(block, points, replace(tie, verdict=np.array(["kept"])))
    adjusted = bundle(block, points, start(OF, block, tie))
    assert len(rows_of(adjusted, "image_point")) == len(OF.image)
    assert_is_the_block(adjusted, OF)


def test_where_nothing_is_to_be_rejected_rays_of_a_rejected_strip_tie_take_part(tmp_path: Path) -> None:
    rows, measured = np.flatnonzero((OF.image > 2) & (OF.point == 14)), OF.xy_mm.copy()
    measured[rows] += [1.5, -2.0]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    second = str(block.strips.id[block.images.strip[4]])
    tie = replace(suspected("strip_tie", [-1]), image=np.array([second]), point=np.array(["p14"]))
    searched = bundle(block, points, start(OF, block, tie))
    assert set(searched.suspects.row[searched.suspects.kind == "image_point"].tolist()) == set(rows.tolist())
    as_measured = bundle(block, points, start(OF, block, tie), options=BundleOptions(blunders="none", max_sigma0=1e4))
    assert len(rows_of(as_measured, "image_point")) == len(OF.image)


@pytest.mark.parametrize("kind", ["control", "position"])
def test_control_and_positions_that_were_rejected_stay_out(tmp_path: Path, kind: str) -> None:
    """Wrong by 20 m at full weight, where all the others are right."""
    strong = ground_rows(OF, CORNERS)
    wrong = ground_rows(OF, (14,), off=20.0 if kind == "control" else 0.0).splitlines()[1]
    positions = OF.position_m.copy()
    positions[4] += 20.0 if kind == "position" else 0.0
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), positions, ",0.1,0.1,0.1", ",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=strong + wrong + "\n", exterior=exterior)
    row = 4 if kind == "position" else int(np.flatnonzero(block.points.id[block.ground_points.point] == "p14")[0])
    found = bundle(block, points, start(OF, block, suspected(kind, [row])))
    assert_is_the_block(found, OF)
    assert found.suspects.verdict.tolist() == ["rejected"]
    assert row not in found.residuals.row[rows_of(found, kind)]
    assert len(rows_of(found, kind)) == (5 if kind == "position" else 4)


def test_positions_that_an_earlier_stage_has_all_rejected_stay_out_where_nothing_converges_with_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    positions, failures, adjusted = OF.position_m[::-1] + 20.0, [ConvergenceError("none")], _adjusted.adjusted_block

    def diverging_at_first(*given: Any) -> Any:
        if failures:
            raise failures.pop()
        return adjusted(*given)

    monkeypatch.setattr(_adjusted, "adjusted_block", diverging_at_first)
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), positions, ",0.1,0.1,0.1", ",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior=exterior)
    context, suspects = Heard(), suspected("position", range(len(positions)))
    solution = bundle(block, points, start(OF, block, suspects), context=context)
    assert_is_the_block(solution, OF)
    assert (solution.suspects.verdict == "rejected").all()
    assert [text for text in context.warned if "no adjustment succeeds" in text and "6 position" in text]


def test_a_right_control_point_that_was_rejected_before_does_not_stay_out_in_place_of_a_wrong_one(
    tmp_path: Path,
) -> None:
    """A strip that few control points hold is bent by the wrong one until a right one disagrees."""
    wrong, right = 5, 24
    ground = (
        ground_rows(OF, tuple(k for k in CORNERS if k != wrong)) + ground_rows(OF, (wrong,), off=5.0).splitlines()[1]
    )
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), None, ",0.1,0.1,0.1", ",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=ground + "\n", exterior=exterior)
    row = {k: int(np.flatnonzero(block.points.id[block.ground_points.point] == f"p{k:02}")[0]) for k in (wrong, right)}
    found = bundle(block, points, start(OF, block, suspected("control", [row[right]])))
    assert dict(zip(found.suspects.row.tolist(), found.suspects.verdict.tolist())) == {
        row[right]: "readmitted",
        row[wrong]: "rejected",
    }
    assert_is_the_block(found, OF)


def test_an_exact_position_that_was_rejected_is_no_longer_demanded(tmp_path: Path) -> None:
    positions = OF.position_m.copy()
    positions[4] += 20.0
    lines = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), positions, ",0.1,0.1,0.1", ",sX,sY,sZ").splitlines()
    lines[5] = lines[5].replace(",0.1,0.1,0.1", ",0,0,0")
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior="\n".join(lines) + "\n")
    assert (block.exterior.position_covariance_m2[4] == 0.0).all()
    found = bundle(block, points, start(OF, block, suspected("position", [4])))
    assert_is_the_block(found, OF)
    assert found.suspects.verdict.tolist() == ["rejected"]


def test_a_suspect_without_a_row_or_of_another_table_rejects_no_image_point(tmp_path: Path) -> None:
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS))
    found = bundle(block, points, start(OF, block, suspected("image_point", [-1])))
    assert len(rows_of(found, "image_point")) == len(OF.image)
    found = bundle(block, points, start(OF, block, suspected("model_tie", [3])))
    assert len(rows_of(found, "image_point")) == len(OF.image)


def test_right_rays_come_back_to_a_point_that_was_left_with_a_wrong_one(tmp_path: Path) -> None:
    """Of three rays a right one was rejected: the wrong one and the other right one meet far away."""
    rows = np.flatnonzero(OF.point == 11)
    measured = OF.xy_mm.copy()
    wrong = rows[0]
    measured[wrong] += [30.0, 1.0]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    begin = start(OF, block, suspected("image_point", rows[1:-1].tolist()))
    xyz_m = begin.points.xyz_m.copy()
    xyz_m[points.measurements.point[wrong]] = np.nan
    found = bundle(block, points, replace(begin, points=replace(begin.points, xyz_m=xyz_m)))
    used = found.residuals.row[rows_of(found, "image_point")]
    assert np.isin(rows, used).tolist() == [False, *[True] * (len(rows) - 1)]
    assert_is_the_block(found, OF)


def test_a_point_that_a_wrong_ray_holds_off_by_a_rejection_before_is_asked_again(tmp_path: Path) -> None:
    """A wrong ray and a right one meet 30 m off, as no test of these two sees; the other right ones were rejected."""
    rows = np.flatnonzero(OF.point == 14)
    wrong, right = rows[0], rows[-1]
    off = OF.xyz_m.copy()
    off[14] += 0.05 * (OF.position_m[OF.image[right]] - off[14])
    measured = OF.xy_mm.copy()
    measured[wrong] = projected(OF.position_m, OF.rotation, off, OF.image[[wrong]], OF.point[[wrong]])[0]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    begin = start(replace(OF, xyz_m=off), block, suspected("image_point", rows[1:-1].tolist()))
    found = bundle(block, points, begin)
    used = found.residuals.row[rows_of(found, "image_point")]
    assert np.isin(rows, used).tolist() == [False, *[True] * (len(rows) - 1)]
    assert_is_the_block(found, OF)


def test_what_a_rejection_before_leaves_open_is_not_taken_as_decided(tmp_path: Path) -> None:
    """Of three rays in a line a right one was rejected: any of the three may be wrong, and the point is none."""
    seen = np.flatnonzero((OF.point == 14) & (OF.image >= 3))
    keep = (OF.point != 14) | np.isin(np.arange(len(OF.point)), seen)
    of = replace(OF, image=OF.image[keep], point=OF.point[keep], xy_mm=OF.xy_mm[keep].copy())
    rows = np.flatnonzero(of.point == 14)
    assert len(rows) == 3
    off = of.xyz_m.copy()
    off[14] += 0.01 * (of.position_m[of.image[rows[2]]] - off[14])
    measured = of.xy_mm.copy()
    measured[rows[0]] = projected(of.position_m, of.rotation, off, of.image[rows[:1]], of.point[rows[:1]])[0]
    block, points = read(tmp_path, of, ground=ground_rows(of, CORNERS), xy_mm=measured)
    found = bundle(block, points, start(replace(of, xyz_m=off), block, suspected("image_point", [int(rows[1])])))
    assert set(found.suspects.verdict.tolist()) == {"undecidable"}
    assert set(found.suspects.row.tolist()) >= {int(rows[1])}
    assert len(found.suspects) >= 2


def test_of_two_rays_that_an_earlier_stage_rejected_neither_is_blamed(tmp_path: Path) -> None:
    """One of the two is wrong, and nothing tells which: the bundle says so, whatever was said before."""
    rows = np.flatnonzero(OF.point == 14)
    keep = ~np.isin(np.arange(len(OF.point)), rows[2:])
    of = replace(OF, image=OF.image[keep], point=OF.point[keep], xy_mm=OF.xy_mm[keep].copy())
    rows = np.flatnonzero(of.point == 14)
    measured = of.xy_mm.copy()
    measured[rows[0]] += [0.7, 0.7]
    block, points = read(tmp_path, of, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    found = bundle(block, points, start(OF, block, suspected("image_point", rows.tolist())))
    assert found.suspects.verdict.tolist() == ["undecidable", "undecidable"]


def test_two_of_an_image_that_an_earlier_stage_rejected_have_exchanged_numbers(tmp_path: Path) -> None:
    rows = np.flatnonzero((OF.image == 1) & (np.bincount(OF.point)[OF.point] > 3))[[0, -1]]
    measured = OF.xy_mm.copy()
    measured[rows] = measured[rows[::-1]]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    found = bundle(block, points, start(OF, block, suspected("image_point", rows.tolist())))
    assert found.suspects.verdict.tolist() == ["swapped", "swapped"]


def test_a_gross_error_rejected_before_does_not_come_back_where_standard_deviations_are_too_small(
    tmp_path: Path,
) -> None:
    """Good ones do that an earlier stage rejected by them; what is wrong by any of them would bend the block."""
    measured = OF.xy_mm + np.random.default_rng(1).normal(0, 0.0125, OF.xy_mm.shape)  # stated: 0.005 mm
    wrong, good = 7, 40
    measured[wrong] += [5.0, -20.0]
    measured[good] = OF.xy_mm[good] + [0.03, -0.02]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    heard = Heard()
    found = bundle(block, points, start(OF, block, suspected("image_point", [wrong, good])), context=heard)
    verdict = dict(zip(found.suspects.row.tolist(), found.suspects.verdict.tolist()))
    assert verdict == {wrong: "rejected", good: "readmitted"}
    sigma0 = [float(line.split("sigma0 ")[1].split(",")[0]) for line in heard.logged if line.startswith("iteration ")]
    assert max(sigma0) < 5.0


@pytest.mark.slow
def test_gross_errors_that_come_back_do_not_bring_the_others_back() -> None:
    """Of a small block the tail of good errors is badly known, and longer with each gross error that is in use."""
    flight = {"strips": 3, "images_per_strip": 5, "forward_overlap": 60.0, "side_overlap": 35.0, "scale_number": 5000.0}
    block = simulated(
        42005,
        camera={"kind": "film", "fiducials": 8},
        flight={**flight, "tilt_sigma_deg": 2.0, "tilt_max_deg": 15.0, "kappa_sigma_deg": 20.0},
        terrain={"mean_height_m": 800.0, "relief_m": 20.0, "wavelength_m": 300.0},
        ties={"per_position": 5},
        known={"full": 5, "check_full": 3},
        gnss={"observed": False},
        earth="flat",
        refraction="none",
        noise={"image_um": 5.0},
        gross_errors={"image_points": 0.03},
    )
    points = affine(block)
    initial = graph(block, points, rng=np.random.default_rng(1))
    wrong = set(block.gross_errors.row.tolist())
    before, solution = initial.suspects, bundle(block, points, initial)
    found = [set(s.row[s.staying_out & (s.kind == "image_point")].tolist()) for s in (before, solution.suspects)]
    assert len(found[0] & wrong) >= 10
    assert len(found[1] & wrong) >= 0.9 * len(found[0] & wrong)
    assert solution.sigma0 < 1.15


def test_rays_do_not_come_back_against_more_others_than_may_be_rejected(tmp_path: Path) -> None:
    """Points that carry two objects, of which a stage before has kept that of two rays: repeated texture."""
    rng, xyz, measured, rejected = np.random.default_rng(4), OF.xyz_m.copy(), OF.xy_mm.copy(), []
    points_of_two = np.flatnonzero((np.bincount(OF.point) >= 4) & ~np.isin(np.arange(len(xyz)), CORNERS))[::3]
    for point in points_of_two:
        rows = np.flatnonzero(OF.point == point)
        xyz[point] += rng.uniform(100, 200, 3) * [1, 1, 0.2]
        measured[rows[:2]] = projected(OF.position_m, OF.rotation, xyz, OF.image[rows[:2]], OF.point[rows[:2]])
        rejected += rows[2:].tolist()
    measured[np.flatnonzero(~np.isin(OF.point, points_of_two))[10]] += [0.0, 1.0]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    heard = Heard()
    adjusted = bundle(block, points, start(OF, block, suspected("image_point", rejected), xyz_m=xyz), context=heard)
    assert not [text for text in heard.warned if "not searched for" in text]
    np.testing.assert_allclose(adjusted.images.position_m, OF.position_m, atol=1e-6)
