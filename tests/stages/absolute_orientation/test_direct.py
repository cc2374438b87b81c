"""Direct georeferencing: as exact as its observations, as accurate as theory says, and nothing without them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.stages.absolute_orientation.direct import direct
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.small_blocks import C_MM
from tests.small_blocks import flown as small_flown
from tests.stages.bundle_adjustment.test_attitudes import flown
from tests.stages.film_blocks import Told
from tests.stages.geodetic_blocks import figures

ARM = (0.2, -0.1, 0.4)


@pytest.mark.parametrize("system", ["omega-phi-kappa", "roll-pitch-heading"])
def test_without_errors_orientations_and_points_are_the_true_ones(system: str) -> None:
    block = flown(1, {"noise": False, "gnss": {"lever_arm_m": ARM}}, rotation=system)
    solution = direct(block, calibrated(block))
    found = figures(block, solution)
    assert found["truth_position_rmse_x_m"] < 1e-7
    assert found["truth_rotation_rmse_rad"] < 1e-7  # axes of the antenna's place for those of the centre: 0.16 urad/m
    assert found["truth_rmse_z_m"] < 1e-4  # difference quotients of the simulation's axes


@pytest.mark.slow
def test_check_points_are_as_accurate_as_theory_says() -> None:
    over, nees, sigma0 = [], [], []
    for seed in range(1, 11):
        block = flown(seed, {"gnss": {"lever_arm_m": ARM}})
        solution = direct(block, calibrated(block))
        found = figures(block, solution)
        over.append([found[f"check_rmse_{a}_m"] ** 2 / found[f"check_theory_rmse_{a}_m"] ** 2 for a in "xyz"])
        nees.append(found["truth_nees"])
        sigma0.append(solution.sigma0)
    assert 0.6 < np.mean(over) < 1.5  # 10 blocks of 4 check points, which share poses
    assert 0.75 < np.mean(nees) < 1.25
    assert 0.9 < np.mean(sigma0) < 1.1


def test_orientations_alone_need_no_image_points() -> None:
    block = flown(1)
    solution = direct(block)
    assert solution.images.oriented.all()
    assert np.isnan(solution.points.xyz_m).all()
    assert (solution.observations, solution.unknowns, solution.redundancy) == (0, 0, 0)
    assert (np.einsum("nii->ni", solution.images.covariance) > 0).all()


def test_an_image_without_angles_is_named_and_a_block_without_any_refused() -> None:
    block, heard = flown(1), Told()
    e = block.exterior
    use = e.angle_use.copy()
    use[3] = 0
    solution = direct(replace(block, exterior=replace(e, angle_use=use)), context=heard)
    assert solution.images.oriented.sum() == len(block.images) - 1
    assert any(str(block.images.id[3]) in text for text in heard.warnings)
    with pytest.raises(GeometryError, match="observed angles"):
        direct(replace(block, exterior=replace(e, angle_use=0 * use)))


def test_a_free_boresight_is_told() -> None:
    heard = Told()
    direct(flown(1, boresight="free"), context=heard)
    assert any("boresight is free" in text for text in heard.warnings)


def test_points_are_those_of_a_dense_intersection_with_their_poses_observed(tmp_path: Path) -> None:
    """Point by point: positions and angles of its images are unknowns with their sigmas."""
    small = small_flown(2, 3, points=6, apart_m=350.0, seed=5)
    small.observed, small.attitudes = dict.fromkeys(small.strip, "XYZ"), list(small.strip)
    block = tables(options=TablesOptions(path=small.write(tmp_path / "b")))
    points = calibrated(block)
    solution, m, e = direct(block, points), points.measurements, block.exterior
    intersected = np.flatnonzero(np.isfinite(solution.points.xyz_m).all(axis=1))
    for p in intersected[::6].tolist():
        rays = np.flatnonzero(m.point == p)
        rows = np.array([e.image.tolist().index(i) for i in m.image[rays].tolist()])
        near, angles, centre = solution.points.xyz_m[p], e.angles_rad[rows], e.position_m[rows]
        sigma_m, sigma_rad = np.sqrt(np.einsum("nii->ni", e.position_covariance_m2[rows])), e.angle_sigma_rad[rows]

        def residuals(z: Any, data: Any = (rays, near, angles, centre, sigma_m, sigma_rad)) -> Any:
            rays, near, angles, centre, sigma_m, sigma_rad = data
            poses = z[3:].reshape(-1, 6)
            R = Rotation.from_euler("XYZ", angles + poses[:, 3:] * sigma_rad)
            u = R.inv().apply(z[:3] + near - centre - poses[:, :3] * sigma_m)
            v = (-C_MM * u[:, :2] / u[:, 2:] - m.xy_mm[rays]) / m.sigma_mm[rays]
            return np.concatenate([v.ravel(), z[3:]])

        dense = least_squares(residuals, np.zeros(3 + 6 * len(rays)), x_scale="jac", jac="3-point", xtol=1e-12)
        sigma = np.sqrt(np.diag(np.linalg.inv(dense.jac.T @ dense.jac))[:3])
        assert (np.abs(dense.x[:3]) < 0.01 * sigma).all()
        np.testing.assert_allclose(np.sqrt(np.diag(solution.points.covariance_m2[p])), sigma, rtol=2e-3)


def test_an_image_turned_by_a_degree_is_named_and_good_ones_are_not(tmp_path: Path) -> None:
    small = small_flown(2, 4, points=10, apart_m=350.0, seed=6)
    small.observed, small.attitudes = dict.fromkeys(small.strip, "XYZ"), list(small.strip)
    block, heard = tables(options=TablesOptions(path=small.write(tmp_path / "b"))), Told()
    direct(block, calibrated(block), context=heard)
    assert heard.warnings == []
    angles = block.exterior.angles_rad.copy()
    angles[2, 2] += np.radians(1.0)
    turned = replace(block, exterior=replace(block.exterior, angles_rad=angles))
    direct(turned, calibrated(turned), context=heard)
    (told,) = heard.warnings
    assert "rays miss each other: sigma0 " in told
    assert f"largest residuals in images {block.images.id[block.exterior.image[2]]} (" in told
