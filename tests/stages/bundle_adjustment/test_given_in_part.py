"""Positions and attitudes of which some coordinates or angles are given, weighted or exact: each acts by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.alternating import alternating
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.bundle_adjustment.intersection import intersection
from aatri.stages.bundle_adjustment.resection import ResectionOptions, resection
from aatri.stages.image_refinement.additional_parameters import additional_parameters
from tests.stages.hand_block import C_MM, Hand, Heard, angles_deg, ground_rows, hand, read, start

COLUMNS = ("X", "Y", "Z", "a1", "a2", "a3", "sX", "sY", "sZ", "sXY", "s1", "s2", "s3", "refers_to", "drift_group")
LARGE_M, LARGE_DEG = 1e5, 1e3


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


def exterior(rows: list[dict[str, Any]]) -> str:
    """exterior.csv of images i0, i1 ..., a mapping of cells each."""
    lines = [",".join([f"i{k}", *(str(row.get(c, "")) for c in COLUMNS)]) for k, row in enumerate(rows) if row]
    return "\n".join([",".join(["image", *COLUMNS]), *lines]) + "\n"


def adjusted(
    folder: Path, of: Hand, rows: list[dict[str, Any]], more: Any = None, camera: Any = None, **options: Any
) -> Solution:
    """The hand block with these rows of the exterior and five control points."""
    block, image_points = made(folder, of, rows, more, camera)
    return bundle(
        block, image_points, start(of, block), options=BundleOptions(blunders="none", tolerance=1e-6, **options)
    )


def made(folder: Path, of: Hand, rows: list[dict[str, Any]], more: Any, camera: Any) -> tuple[Block, ImagePoints]:
    return read(
        folder, of, ground=ground_rows(of, [0, 5, 14, 24, 29]), exterior=exterior(rows), more=more, camera=camera
    )


def cells(of: Hand, k: int, off: Any = (0.0, 0.0, 0.0)) -> dict[str, float]:
    return dict(zip("XYZ", (of.position_m[k] + off).tolist()))


def same(one: Solution, other: Solution, atol: float = 1e-6) -> None:
    np.testing.assert_allclose(one.images.position_m, other.images.position_m, atol=atol, rtol=0)
    np.testing.assert_allclose(one.images.ground_from_image, other.images.ground_from_image, atol=atol / 100, rtol=0)
    sigmas = [np.sqrt(np.einsum("nii->ni", s.images.covariance)) for s in (one, other)]
    np.testing.assert_allclose(*sigmas, rtol=1e-3, atol=2e-5)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("given", ["Z", "XY", "Y", "XZ"])
def test_coordinates_given_alone_are_those_whose_others_say_nothing(of: Hand, given: str, tmp_path: Path) -> None:
    off = np.array([0.3, -0.2, 0.4])
    alone, with_others = [], []
    for k in range(6):
        all_three = cells(of, k, (k - 2) * off)
        alone.append({c: all_three[c] for c in given} | {f"s{c}": 0.05 for c in given})
        with_others.append(all_three | {f"s{c}": 0.05 if c in given else LARGE_M for c in "XYZ"})
    found = adjusted(tmp_path / "alone", of, alone)
    same(found, adjusted(tmp_path / "others", of, with_others))
    assert np.abs(found.images.position_m - of.position_m).max() > 0.01
    mine = found.residuals.take(found.residuals.kind == "position")
    assert np.isfinite(mine.residual).sum() == 6 * len(given)


@pytest.mark.parametrize("given", [(2,), (0, 1), (1,)])
@pytest.mark.parametrize("system", ["omega-phi-kappa", "phi-omega-kappa"])
def test_an_angle_given_alone_is_that_whose_others_say_nothing(
    of: Hand, system: str, given: tuple[int, ...], tmp_path: Path
) -> None:
    alone, with_others = [], []
    off = np.array([0.01, -0.008, 0.005, 0.0, -0.01, 0.02])
    for angles in angles_deg(of, system) + off[:, None]:
        a = {f"a{j + 1}": angles[j] for j in range(3)}
        alone.append({f"a{j + 1}": a[f"a{j + 1}"] for j in given} | {f"s{j + 1}": 0.002 for j in given})
        with_others.append(a | {f"s{j + 1}": 0.002 if j in given else LARGE_DEG for j in range(3)})
    more = {"rotation": system}
    found = adjusted(tmp_path / "alone", of, alone, more)
    # Three angles are compared as a rotation vector: the same but for the square of the 3e-4 rad they are off.
    same(found, adjusted(tmp_path / "others", of, with_others, more), atol=2e-4)
    turned = Rotation.from_matrix(of.rotation.swapaxes(1, 2) @ found.images.ground_from_image).magnitude()
    assert turned.max() > 1e-5


def test_exact_coordinates_hold_to_the_last_digit_beside_weighted_ones(of: Hand, tmp_path: Path) -> None:
    rows = [cells(of, k, [0.2, -0.1, 0.15]) | {"sX": 0, "sY": 0.05, "sZ": 0.05} for k in range(3)]
    rows += [
        {"Z": of.position_m[3, 2] - 0.3, "sZ": 0},
        {},
        cells(of, 5, [0.1, 0.1, 0.1]) | dict.fromkeys(("sX", "sY", "sZ"), 0),
    ]
    found = adjusted(tmp_path, of, rows)
    got = found.images.position_m
    np.testing.assert_allclose(got[:3, 0], of.position_m[:3, 0] + 0.2, atol=1e-9)
    np.testing.assert_allclose(got[3, 2], of.position_m[3, 2] - 0.3, atol=1e-9)
    np.testing.assert_allclose(got[5], of.position_m[5] + 0.1, atol=1e-9)
    sigma = np.sqrt(np.einsum("nii->ni", found.images.covariance))
    assert sigma[5, :3].max() < 1e-9 < sigma[3, 0]
    assert sigma[3, 2] < 1e-9 < sigma[4, 2]
    loose = [row | {s: 1e-5 for s in ("sX", "sY", "sZ") if row.get(s) == 0} for row in rows]
    same(found, adjusted(tmp_path / "loose", of, loose), atol=1e-5)


def test_exact_positions_of_antennas_hold_with_arm_and_covariance(of: Hand, tmp_path: Path) -> None:
    arm = np.array([0.4, -0.3, 1.2])
    antenna = of.position_m + of.rotation @ arm
    rows = [
        dict(zip("XYZ", (antenna[k] + 0.1).tolist()))
        | {"sX": 0.05, "sY": 0.05, "sXY": 0.001, "sZ": 0, "refers_to": "antenna"}
        for k in range(6)
    ]
    found = adjusted(tmp_path, of, rows, camera={"lever_arm": arm.tolist()})
    got = found.images.position_m + found.images.ground_from_image @ arm
    np.testing.assert_allclose(got[:, 2], antenna[:, 2] + 0.1, atol=1e-9)


def test_exact_heights_leave_their_shift_and_drift_to_a_group(of: Hand, tmp_path: Path) -> None:
    """Heights of a barometer: a shift and a drift of all, whatever their size, change nothing; plan is not touched."""
    rows = [{"Z": of.position_m[k, 2] + 30.0 + 2.0 * (k % 3), "sZ": 0, "drift_group": "g"} for k in range(6)]
    found = adjusted(tmp_path, of, rows)
    np.testing.assert_allclose(found.images.position_m, of.position_m, atol=1e-6)
    group = found.parameters.take(found.parameters.name == "shift Z")
    assert len(group.value) == 1
    assert not np.isin(["shift X", "drift Y"], found.parameters.name).any()


@pytest.mark.parametrize("exact", ["a3", "all"])
def test_exact_angles_hold_to_the_last_digit(of: Hand, exact: str, tmp_path: Path) -> None:
    system = "omega-phi-kappa"
    given = angles_deg(of, system) + np.array([0.01, -0.02, 0.03])
    rest = 0 if exact == "all" else 0.01
    rows = [{"a1": a[0], "a2": a[1], "a3": a[2], "s1": rest, "s2": rest, "s3": 0} for a in given]
    if exact == "a3":
        rows[2] = {"a3": given[2, 2], "s3": 0}
    found = adjusted(tmp_path, of, rows)
    got = Rotation.from_matrix(found.images.ground_from_image).as_euler("XYZ", degrees=True)
    columns = [2] if exact == "a3" else [0, 1, 2]
    np.testing.assert_allclose(got[:, columns], given[:, columns], atol=1e-9)


@pytest.mark.parametrize("curvature", ["frame", "correct"])
def test_heights_alone_hold_in_a_map_far_from_its_origin(curvature: str, tmp_path: Path) -> None:
    """The block is not of a round earth; exact heights of all images come out as they were given all the same."""
    of = hand((440_000.0, 4_500_000.0, 50.0))
    more = {"frames": {"map": {"axes": ["east", "north", "up"], "crs": "EPSG:32650"}}, "earth_curvature": curvature}
    rows = [{"Z": of.position_m[k, 2] + 0.02 * k, "sZ": 0} for k in range(6)]
    found = adjusted(tmp_path, of, rows, more)
    np.testing.assert_allclose(found.images.position_m[:, 2], of.position_m[:, 2] + 0.02 * np.arange(6), atol=2e-7)


@pytest.mark.parametrize("sigma", [0.1, 0])
def test_what_is_known_of_held_images_or_points_is_no_redundancy(of: Hand, sigma: float, tmp_path: Path) -> None:
    """Positions, attitudes in an intersection, control in a resection: off by any amount, they change nothing."""
    angles = angles_deg(of, "omega-phi-kappa")
    rows = [
        cells(of, k, [9.0, 9.0, 9.0])
        | {f"a{j + 1}": angles[k, j] for j in range(3)}
        | dict.fromkeys(("sX", "sY", "sZ", "s1", "s2", "s3"), sigma)
        for k in range(6)
    ]
    block, points = made(tmp_path, of, rows, None, None)
    begun, heard = start(of, block), Heard()
    found = intersection(block, points, begun, context=heard)  # type: ignore[arg-type]
    seen = np.bincount(of.point, minlength=30) > 1
    assert found.redundancy == 2 * seen[of.point].sum() + 15 - 3 * seen.sum()
    assert any("6 of kind position" in text and "6 of kind attitude" in text for text in heard.logged)
    resected = resection(block, points, begun, options=ResectionOptions(positions={"use": False}))  # type: ignore[call-arg]
    if sigma:
        assert resected.redundancy == 2 * len(of.point) + 18 - 36
    alternated = alternating(
        *made(tmp_path, of, [cells(of, k) | dict.fromkeys(("sX", "sY", "sZ"), sigma) for k in range(6)], None, None),
        begun,
    )
    np.testing.assert_allclose(alternated.images.position_m, of.position_m, atol=1e-6)


# -- AICON's parameters are those of the image error at the projection, however large the distortion --


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
