"""A distortion of zeros is none: such a block is written for other programs; one with numbers is fitted."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.formats.bal.problem import write_bal_problem
from aatri.formats.colmap.writer import write_colmap_model
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.wucaps.writer import write_oriented
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.formats.told import Told
from tests.reading import read_colmap, read_dbat
from tests.stages.chain import simulated


@pytest.fixture(scope="module")
def made(shared_data: Path) -> tuple[Block, Solution]:
    folder = shared_data / "dbat" / "sxb"
    block = read_dbat(folder / "w-op0-no-orient-pmexport.txt", folder / "ctrlpts-weighted.txt")
    assert block.cameras.distortion.tolist() == ["brown"]
    return block, bundle(block, calibrated(block))


def test_a_real_block_whose_distortion_is_zero_is_written_for_colmap_and_read_back(
    made: tuple[Block, Solution], tmp_path: Path
) -> None:
    block, solution = made
    write_colmap_model(OrientedBlock(block, solution, calibrated(block)), tmp_path / "model")
    again = read_colmap(tmp_path / "model", max_reject_share=0.1)  # one point is seen once, and no control there
    assert sorted(again.images.id) == sorted(block.images.id)
    np.testing.assert_allclose(
        again.cameras.principal_distance_mm / again.cameras.pixel_size_mm[:, 0],
        block.cameras.principal_distance_mm / block.cameras.pixel_size_mm[:, 0],
    )


def with_k1(block: Block, solution: Solution, value: float) -> OrientedBlock:
    given, solved = block.camera_parameters, solution.parameters
    return OrientedBlock(
        replace(block, camera_parameters=replace(given, value=np.where(given.name == "k1", value, given.value))),
        replace(solution, parameters=replace(solved, value=np.where(solved.name == "k1", value, solved.value))),
    )


@pytest.mark.parametrize("write", [write_colmap_model, write_bal_problem])
def test_with_a_number_it_is_fitted_and_refused_beyond_the_misfit_allowed(
    made: tuple[Block, Solution], tmp_path: Path, write: Callable[..., None]
) -> None:
    block, solution = made
    bent = with_k1(block, solution, 1e-8)
    told = Told()
    write(bent, tmp_path / "taken", Writing(lens_misfit_px=0.05), told)
    assert re.search(r"its distortion \(brown\) has no exact like; .* differs by up to \S+ px", "".join(told.lines))
    with pytest.raises(InputError, match="has no exact like"):
        write(bent, tmp_path / "refused", Writing(lens_misfit_px=0.0), told)
    assert not (tmp_path / "refused").exists()


def test_a_distortion_table_is_refused(made: tuple[Block, Solution], tmp_path: Path) -> None:
    block, solution = made
    table = replace(block, cameras=replace(block.cameras, distortion=np.array(["table"])))
    with pytest.raises(InputError, match="distortion table corrects the measured coordinates"):
        write_colmap_model(OrientedBlock(table, solution), tmp_path / "model")
    assert not (tmp_path / "model").exists()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("known", [False, True])
def test_rays_are_exported_free_of_the_distortion_that_is_known_or_that_self_calibration_found(
    tmp_path: Path, known: bool
) -> None:
    """Independent check: pinhole projection of the written model meets its written rays as the noise is, 1 um.

    COLMAP, and WuCAPS, whose image points kept what the bundle takes off, 24 um, beside a camera without distortion.
    """
    camera = {
        "kind": "digital",
        "principal_distance_mm": 50.0,
        "format": (6000.0, 4000.0),
        "pixel_size_mm": 0.006,
        "distortion": "brown",
        "brown": {"k1": 3e-6, "p1": 2e-6},
        "distortion_known": known,
    }
    block = simulated(
        camera=camera,
        flight={"strips": 2, "images_per_strip": 5, "side_overlap": 60.0},
        noise={"image_um": 1.0},
        refraction="none",
        known={"full": 8},
    )
    points = calibrated(block)
    start = graph(block, points, rng=np.random.default_rng(1))
    options = BundleOptions() if known else BundleOptions(self_calibration={"set": "brown_conrady"})
    solution = bundle(block, points, start, options=options)
    write_colmap_model(OrientedBlock(block, solution, points), tmp_path / "model")
    cameras, images, xyz = _written(tmp_path / "model")
    misfit_px = []
    for quaternion, translation, rays in images:
        w, x, y, z = quaternion
        axis = np.array([x, y, z])
        cross = np.cross(np.eye(3), axis)
        R = (w * w - axis @ axis) * np.eye(3) + 2 * np.outer(axis, axis) + 2 * w * cross
        for column, row, name in rays:
            u = R @ xyz[int(name)] + translation
            misfit_px.append(np.hypot(*(cameras[0] * u[:2] / u[2] + cameras[1:3] - (column, row))))
    noise_px = 1.0 / 6.0  # 1 um of pixels of 6 um; residuals are smaller than the noise by the share of redundancy
    assert 0.3 * noise_px < np.sqrt(np.mean(np.square(misfit_px)) / 2) < noise_px
    write_oriented(OrientedBlock(block, solution, points), tmp_path / "wucaps", AS_USUAL, Told())
    misfit_mm = _misfits_of_wucaps(tmp_path / "wucaps")
    assert len(misfit_mm) == len(misfit_px)
    assert 0.3e-3 < np.sqrt(np.mean(np.square(misfit_mm)) / 2) < 1e-3


def _misfits_of_wucaps(folder: Path) -> list[float]:
    """Written photo coordinates against the results beside: north, east, up; R = Ry(-phi) Rx(omega) Rz(kappa)."""
    lines = {
        name: [row.split() for row in (folder / f"{name}.DAT").read_text().splitlines()]
        for name in ("PRECAI", "PREPHI", "RESORI", "RESPNT")
    }
    c_mm, *principal_point = map(float, lines["PRECAI"][1])
    assert principal_point == [0.0, 0.0]
    xyz = {row[0]: np.array(row[1:4], float)[[1, 0, 2]] for row in lines["RESPNT"] if len(row) > 3}
    pose = {}
    for name, *numbers in (row for row in lines["RESORI"] if len(row) > 6):
        north, east, up, phi, omega, kappa = map(float, numbers[:6])
        turn = Rotation.from_euler("YXZ", [-phi, omega, kappa], degrees=True).as_matrix()
        pose[name] = np.array([east, north, up]), turn
    misfits, image = list[float](), ""
    for row in lines["PREPHI"]:
        if len(row) == 2:
            image = row[0].lstrip("-")
        elif len(row) == 3 and row[0] != "-99":
            X0, R = pose[image]
            u = R.T @ (xyz[row[0]] - X0)
            misfits.append(float(np.hypot(*(-c_mm * u[:2] / u[2] - np.array(row[1:], float)))))
    return misfits


def _written(folder: Path) -> tuple[Float, list[tuple[Float, Float, Float]], dict[int, Float]]:
    """f cx cy of the camera, (quaternion, translation, rays) of images, points by name: as COLMAP defines them."""
    lines = {
        name: [row.split() for row in (folder / f"{name}.txt").read_text().splitlines() if row[:1] != "#"]
        for name in ("cameras", "images", "points3D")
    }
    assert lines["cameras"][0][1] == "SIMPLE_PINHOLE"
    images = [
        (np.array(head[1:5], float), np.array(head[5:8], float), np.array(rays, float).reshape(-1, 3))
        for head, rays in zip(lines["images"][::2], lines["images"][1::2])
    ]
    points = {int(row[0]): np.array(row[1:4], float) for row in lines["points3D"]}
    return np.array(lines["cameras"][0][4:7], float), images, points
