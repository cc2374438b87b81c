"""A small block and solutions of it, made by hand: the tests of accuracy, export and report share them.

Two strips of `across` images each over a grid of points 100 m apart; the four corners are control, points of the
second column are check points where asked for. The solution is the truth plus what a test adds.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aatri.artifacts import block as b
from aatri.artifacts import solution as s
from aatri.artifacts.suspects import Suspects
from aatri.geometry.rotations import rotation_from_angles

HEIGHT_M = 400.0


def made_block(
    *, columns: int = 5, rows: int = 4, check: bool = True, truth: bool = True, rays: bool = True, **changes: Any
) -> b.Block:
    """A block of rows x columns points, the corners control, the second column check points."""
    column, row = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    xyz = np.stack([100.0 * column.ravel(), 100.0 * row.ravel(), 10.0 + column.ravel()], axis=1)
    names = [f"p{c}{r}" for c, r in zip(column.ravel(), row.ravel())]
    corner = np.isin(column.ravel(), [0, columns - 1]) & np.isin(row.ravel(), [0, rows - 1])
    middle = (column.ravel() == 1) & check
    given = np.flatnonzero(corner | middle)
    image_names = [f"{strip}-{k}" for strip in (1, 2) for k in range(columns)]
    positions = [[100.0 * k, 100.0 + 100.0 * strip, HEIGHT_M] for strip in (0, 1) for k in range(columns)]
    n_images, n_points = len(image_names), len(names)
    roles = np.where(corner[given, None], b.CONTROL, b.CHECK) * np.ones((1, 3), int)
    image_index, point_index = np.indices((n_images if rays else 0, n_points)).reshape(2, -1)
    fields: dict[str, Any] = {
        "name": "made",
        "rotation": "omega-phi-kappa",
        "earth_curvature": "ignore",
        "terrain_height_m": 12.0,
        "undulation_m": np.nan,
        "heading": "true",
        "files": b.Files.empty(),
        "frames": b.Frames(id=["map"], axes=["east,north,up"], crs=["local"], vertical=[""]),
        "cameras": b.Cameras(
            id=["cam"],
            kind=["film"],
            image_coordinates=["photo"],
            pixel_size_mm=[[np.nan, np.nan]],
            pixel_origin=[""],
            pixel_y=[""],
            format=[[230.0, 230.0]],
            principal_distance_mm=[150.0],
            principal_point_mm=[[0.0, 0.0]],
            symmetry_point_mm=[[0.0, 0.0]],
            distortion=["none"],
            lever_arm_m=[[0.0, 0.0, 0.0]],
            boresight_rad=[[0.0, 0.0, 0.0]],
            mount_deg=[0],
        ),
        "camera_parameters": b.CameraParameters.empty(),
        "distortion_table": b.DistortionTable.empty(),
        "fiducials": b.Fiducials.empty(),
        "rig_members": b.RigMembers.empty(),
        "strips": b.StripIds(id=["1", "2"]),
        "images": b.Images.of(
            id=image_names,
            camera=np.zeros(n_images, int),
            strip=np.repeat([0, 1], columns),
            sequence=np.tile(np.arange(columns), 2).astype(float),
            time_s=np.full(n_images, np.nan),
            flight=[""] * n_images,
            session=[""] * n_images,
            rig=[""] * n_images,
            member=[""] * n_images,
            active=np.ones(n_images, bool),
            file=np.full(n_images, -1),
            line=np.zeros(n_images, int),
        ),
        "fiducial_points": b.FiducialPoints.empty(),
        "points": b.Points(id=names),
        "image_points": b.MeasuredPoints(
            image=image_index,
            point=point_index,
            xy=_projected(xyz, np.array(positions), image_index, point_index),
            sigma_mm=np.full((len(image_index), 2), 0.005),
            group=[""] * len(image_index),
            active=np.ones(len(image_index), bool),
            row_time_s=np.full(len(image_index), np.nan),
            file=np.full(len(image_index), -1),
            line=np.zeros(len(image_index), int),
        ),
        "ground_points": b.GroundPoints(
            point=given,
            xyz_m=xyz[given],
            covariance_m2=np.tile(np.eye(3) * 0.01**2, (len(given), 1, 1)),
            role=roles,
            datum=np.zeros(len(given), bool),
            file=np.full(len(given), -1),
            line=np.zeros(len(given), int),
        ),
        "ground_point_covariances": b.GroundPointCovariances.empty(),
        "exterior": b.Exterior.empty(),
        "geodetic": b.Geodetic.empty(),
        "geodetic_covariances": b.GeodeticCovariances.empty(),
        "relative_control": b.RelativeControl.empty(),
        "relative_control_members": b.RelativeControlMembers.empty(),
        "rejects": b.Rejects.empty(),
    }
    if truth:
        fields["true_images"] = b.TrueImages(
            image=np.arange(n_images),
            position_m=np.array(positions),
            ground_from_image=np.tile(np.eye(3), (n_images, 1, 1)),
        )
        fields["true_points"] = b.TruePoints(point=np.arange(n_points), xyz_m=xyz)
        fields["gross_errors"] = b.GrossErrors.empty()
    return b.Block(**(fields | changes))


def made_solution(block: b.Block, *, shift_m: Any = 0.0, sigma_m: float = 0.02, **changes: Any) -> s.Solution:
    """The truth of the made block plus a shift ((3,) or (points, 3)) of all points; one sigma for every coordinate."""
    column, row = np.array([[int(n[1:-1]), int(n[-1])] for n in block.points.id]).T
    xyz = np.stack([100.0 * column, 100.0 * row, 10.0 + column], axis=1).astype(float) + shift_m
    n_images, n_points = len(block.images), len(block.points)
    columns = n_images // 2
    positions = np.array([[100.0 * k, 100.0 + 100.0 * strip, HEIGHT_M] for strip in (0, 1) for k in range(columns)])
    image_points = np.bincount(block.image_points.image, minlength=n_images)
    wave = 0.005 * np.sin(np.arange(len(block.image_points)) * [[1.0], [0.7]]).T
    control = block.ground_points.role[:, 0] == b.CONTROL
    rows = block.ground_points.point[control]
    n_control, n_rays = len(rows), len(block.image_points)
    fields: dict[str, Any] = {
        "method": "bundle_adjustment/bundle",
        "observations": 2 * n_rays,
        "unknowns": 100,
        "redundancy": 2 * n_rays - 100,
        "sigma0": 1.01,
        "sigma0_um": 5.05,
        "iterations": 4,
        "images": s.ImageOrientations(
            id=block.images.id,
            oriented=np.ones(n_images, bool),
            position_m=positions,
            ground_from_image=rotation_from_angles(np.zeros((n_images, 3))),
            covariance=np.tile(np.diag([1e-4] * 3 + [1e-10] * 3), (n_images, 1, 1)),
            image_points=image_points,
        ),
        "points": s.SolvedPoints(
            id=block.points.id,
            xyz_m=xyz,
            rays=np.full(n_points, n_images),
            covariance_m2=np.tile(np.eye(3) * sigma_m**2, (n_points, 1, 1)),
        ),
        "cameras": s.SolvedCameras(id=["cam"], principal_distance_mm=[150.0], principal_point_mm=[[0.0, 0.0]]),
        "transformations": s.StripTransformations.empty(),
        "parameters": s.Parameters.empty(),
        "residuals": s.Residuals(
            kind=["image_point"] * n_rays + ["control"] * n_control,
            row=np.concatenate([np.arange(n_rays), np.flatnonzero(control)]),
            image=np.concatenate([block.images.id[block.image_points.image], [""] * n_control]),
            point=np.concatenate([block.points.id[block.image_points.point], block.points.id[rows]]),
            residual=np.concatenate([np.column_stack([wave, np.full(n_rays, np.nan)]), np.full((n_control, 3), 0.001)]),
            sigma=np.concatenate([np.tile([0.005, 0.005, np.nan], (n_rays, 1)), np.full((n_control, 3), 0.01)]),
            active=np.ones(n_rays + n_control, bool),
            unit=["mm"] * n_rays + ["m"] * n_control,
        ),
        "history": s.Iterations(cost=[1e6, 1e3, 410.0, 400.0], decrement=[900.0, 20.0, 0.5, 1e-5], damping=[0.0] * 4),
        "suspects": Suspects.empty(),
    }
    return s.Solution(**(fields | changes))


def _projected(xyz: Any, positions: Any, image: Any, point: Any) -> Any:
    u = xyz[point] - positions[image]
    return -150.0 * u[:, :2] / u[:, 2:]
