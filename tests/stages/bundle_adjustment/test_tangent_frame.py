"""Adjustment in a tangent frame of the declared CRS: no map scale, no curvature, the same from any frame given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
import pytest

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.artifacts.block import CONTROL, Block
from aatri.geometry.rotations import angles_from_rotation
from aatri.observations.poses import POINT
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.chain import run_chain
from tests.stages.film_blocks import Told
from tests.stages.geodetic_blocks import figures, made, student


@pytest.mark.slow
@pytest.mark.parametrize("height_m", [100.0, 3000.0])
def test_the_map_scale_does_not_move_heights(height_m: float) -> None:
    rows = []
    for seed in range(1, 11):
        block = made(seed, height_m)
        rows.append(figures(block, bundle(block, calibrated(block))))
    limit = 3.25  # Student, 9 degrees of freedom, 99 %
    assert abs(student(np.array([f["truth_bias_z_m"] for f in rows]), 0.0)) < limit
    # of one such block NEES scatters by 0.24 (50 other seeds, flat earth): 0.08 of the mean, three times
    assert 0.76 < np.mean([f["truth_nees"] for f in rows]) < 1.24


def test_an_adjustment_in_the_map_is_off_by_its_scale_and_says_so() -> None:
    block, heard = replace(made(1, 3000.0), earth_curvature="correct"), Told()
    kept = BundleOptions(blunders="none")  # else the positions are left out: the map has their heights of another scale
    found = figures(block, bundle(block, calibrated(block), options=kept, context=heard))
    assert found["truth_bias_z_m"] == pytest.approx(0.0004 * 3000.0, rel=0.2)
    assert any("of scale 0.99959" in text and "1.2" in text for text in heard.warnings)


def test_the_slope_that_an_undulation_neglects_is_told_with_what_it_does_in_height_and_in_plan() -> None:
    block, heard = replace(made(1, 3000.0), undulation_m=-12.0), Told()
    bundle(block, calibrated(block), options=BundleOptions(blunders="none"), context=heard)
    (text,) = [text for text in heard.lines if "stands for the geoid grid" in text]
    points = block.true_points.xyz_m[:, :2] if block.true_points is not None else np.zeros((1, 2))
    extent_m = float(np.linalg.norm(np.ptp(points, axis=0)))
    assert float(text.split("at worst ")[1].split(" m")[0]) == pytest.approx(5e-5 * extent_m, rel=0.1)
    assert "0.15 m in plan up to the images" in text


@pytest.mark.slow
def test_20_km_with_four_control_points_are_as_good_as_theory_says_through_the_whole_chain() -> None:
    flight = {
        "strips": 4,
        "images_per_strip": 6,
        "scale_number": 110_000.0,
        "position_sigma_m": (5.0, 5.0, 3.0),
        "side_overlap": 30.0,
    }
    errors, theory, nees, bias = [], [], [], []
    for seed in range(1, 11):
        block = made(seed, 11_000.0, flight=flight, gnss={"observed": False}, ties={"per_position": 3})
        block = replace(block, exterior=replace(block.exterior, angles_rad=np.full((len(block.images), 3), np.nan)))
        assert block.true_points is not None
        assert np.ptp(block.true_points.xyz_m[:, :2], axis=0).min() > 20_000.0
        chain = run_chain(block, refraction=False)  # as simulated: 11 km of air would raise it by a metre
        absolute, found = figures(block, chain.absolute), figures(block, chain.bundle)
        assert absolute["truth_rmse_z_m"] < 4.0  # the earth bends by 16 m
        free = graph(block, calibrated(block), rng=np.random.default_rng(seed))
        assert figures(block, free)["truth_rmse_z_m"] < 4.0
        errors.append(found["truth_rmse_z_m"])
        theory.append(found["theory_rmse_z_m"])
        nees.append(found["truth_nees"])
        bias.append(found["truth_bias_z_m"])
    assert abs(student(np.array(bias), 0.0)) < 3.25  # 9 degrees of freedom, 99 %
    assert 0.6 < np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(theory))) < 1.4
    assert 0.5 < np.mean(nees) < 1.6


def test_control_in_plan_or_height_only_stays_right_far_from_the_origin() -> None:
    flight = {"strips": 3, "images_per_strip": 4, "scale_number": 80_000.0}
    block = made(3, 8000.0, flight=flight, known={"full": 4, "plan": 4, "height": 8})
    solution = bundle(block, calibrated(block))
    residuals = solution.residuals
    mine = residuals.kind == "control"
    assert mine.sum() == 16
    w = residuals.residual[mine] / residuals.sigma[mine]
    assert np.isfinite(w).sum() == 12 + 8 + 8
    assert np.nanmax(np.abs(w)) < 4.0  # in the axes of the map: 20 km out, tangent heights would be 8 m off
    found = figures(block, solution)
    assert 0.7 < found["truth_nees"] < 1.4


def test_exact_control_is_kept_exactly_in_the_coordinates_of_the_map() -> None:
    block = made(
        2,
        3000.0,
        noise={"image_um": 2.0, "control_m": (0.0, 0.0, 0.0), "gnss_m": (0.02, 0.02, 0.03)},
        known={"full": 4, "height": 2},
    )
    solution = bundle(block, calibrated(block))
    ground = block.ground_points
    given = np.where(ground.role == CONTROL, ground.xyz_m, np.nan)
    assert np.nanmax(np.abs(solution.points.xyz_m[ground.point] - given)) < 1e-6


def _geographic_rows(xyz: np.ndarray) -> np.ndarray:
    to = pyproj.Transformer.from_crs(pyproj.CRS("EPSG:32650").to_3d(), "EPSG:4979", always_xy=True)
    longitude, latitude, h = to.transform(*xyz.T)
    return np.stack([latitude, longitude, h], axis=1)


def _geocentric(xyz: np.ndarray) -> np.ndarray:
    to = pyproj.Transformer.from_crs(pyproj.CRS("EPSG:32650").to_3d(), "EPSG:4978", always_xy=True)
    return np.stack(to.transform(*xyz.T), axis=1)


def _local(xyz: np.ndarray) -> np.ndarray:
    """Grid east, grid north, up of places in geocentric axes, by difference quotients of PROJ."""
    up = _geocentric(xyz + np.array([0, 0, 100.0])) - _geocentric(xyz)
    north = _geocentric(xyz + np.array([0, 50.0, 0])) - _geocentric(xyz - np.array([0, 50.0, 0]))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    east = np.cross(north, up)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    return np.stack([east, np.cross(up, east), up], axis=2)


def _in_geocentric_axes(block: Block) -> Block:
    """The same block, everything given in geocentric coordinates, by PROJ."""
    ground, e = block.ground_points, block.exterior
    at_points, at_images = _local(ground.xyz_m), _local(e.position_m)
    scale = np.stack(
        [
            np.linalg.norm(_geocentric(e.position_m + s) - _geocentric(e.position_m - s), axis=1) / 100.0
            for s in np.eye(3) * 50.0
        ],
        axis=1,
    )
    scale_p = np.stack(
        [
            np.linalg.norm(_geocentric(ground.xyz_m + s) - _geocentric(ground.xyz_m - s), axis=1) / 100.0
            for s in np.eye(3) * 50.0
        ],
        axis=1,
    )
    T, P = at_images * scale[:, None], at_points * scale_p[:, None]
    assert block.true_images is not None
    from aatri.geometry.rotations import rotation_from_angles

    rotation = at_images @ rotation_from_angles(e.angles_rad)
    return replace(
        block,
        frames=replace(block.frames, axes=np.array(["x,y,z"]), crs=np.array(["EPSG:4978"])),
        ground_points=replace(
            ground, xyz_m=_geocentric(ground.xyz_m), covariance_m2=P @ ground.covariance_m2 @ P.swapaxes(1, 2)
        ),
        exterior=replace(
            e,
            position_m=_geocentric(e.position_m),
            angles_rad=angles_from_rotation(rotation),
            position_covariance_m2=T @ e.position_covariance_m2 @ T.swapaxes(1, 2),
        ),
    )


@pytest.mark.slow
def test_one_block_in_map_geographic_and_geocentric_coordinates_and_two_frames_is_one_result(tmp_path: Path) -> None:
    from aatri.formats.tables.writer import write_block
    from tests.reading import read_block

    block = made(5, 3000.0)
    points = calibrated(block)
    options = BundleOptions()
    first = bundle(block, points)
    sigma = np.sqrt(np.einsum("nii->ni", first.points.covariance_m2))

    def compared(xyz: np.ndarray) -> None:
        assert np.nanmax(np.abs(xyz - first.points.xyz_m) / sigma) < 1e-3

    elsewhere = observation_source(block, points, None, origin=np.array([506_000.0, 4_513_000.0, 0.0]))
    assert elsewhere.frame is not None
    result = adjust_bundle(bundle_input(elsewhere, options))
    compared(elsewhere.frame.to_block(result.adjusted.state[POINT] + elsewhere.origin_m))

    geocentric = _in_geocentric_axes(block)
    second = bundle(geocentric, points)
    to = pyproj.Transformer.from_crs("EPSG:4978", pyproj.CRS("EPSG:32650").to_3d(), always_xy=True)
    compared(np.stack(to.transform(*second.points.xyz_m.T), axis=1))
    D = np.linalg.inv(_local(first.points.xyz_m))
    turned = D @ second.points.covariance_m2 @ D.swapaxes(1, 2)
    np.testing.assert_allclose(np.einsum("nii->ni", turned), sigma**2, rtol=2e-3)  # metres of the ground and the map

    write_block(block, tmp_path / "block")
    folder = tmp_path / "block"
    _rewrite_geographic(folder / "ground_points.csv")
    text = (folder / "block.yaml").read_text()
    wgs = "  wgs: {axes: [latitude, longitude, height], crs: EPSG:4979}\n"
    lines = text.splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if line.startswith("frames:")) + 2
    (folder / "block.yaml").write_text("".join([*lines[:at], wgs, *lines[at:]]))
    third = read_block(folder)
    compared(bundle(third, calibrated(third)).points.xyz_m)


def _rewrite_geographic(path: Path) -> None:
    """Positions of a table as latitude, longitude, height; standard deviations per metre of the ground."""
    import csv

    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for row in rows:
        if not row["X"]:
            continue
        xyz = np.array([[float(row[c]) for c in "XYZ"]])
        place = _geographic_rows(xyz)[0]
        k = [np.linalg.norm(_geocentric(xyz + s) - _geocentric(xyz - s)) / 100.0 for s in np.eye(3) * 50.0]
        for c, value in zip("XYZ", place):
            row[c] = repr(float(value))
        for name, factor in zip(("sX", "sY", "sZ"), (k[1], k[0], k[2])):  # latitude is north
            if row.get(name):
                row[name] = repr(float(row[name]) * float(factor))
        row["frame"] = "wgs"
    names = list(rows[0])
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
