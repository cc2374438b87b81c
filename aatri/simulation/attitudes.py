"""Attitudes as an IMU gives them: its own forward model, by SciPy's rotations.

    R_imu = R_image B',    B the boresight as a rotation vector of the camera axes

omega, phi, kappa are the intrinsic angles X Y Z of R_imu against the axes of the block; phi, omega, kappa those about
-Y X Z; roll, pitch, heading the angles Z Y X of the body (x forward, y right, z down) against north, east, down, of
the grid or of the meridian. A shift and a drift of each strip are added to the angles, and the noise.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.arrays import Float, Int
from aatri.artifacts import block as b
from aatri.simulation.flight import FlightPlan
from aatri.simulation.measured import Disturbance, drift_of_strips
from aatri.simulation.settings import ImuOptions

Gross = tuple[Any, ...]


def observed_attitudes(
    table: b.Exterior,
    truth: Float,
    plan: FlightPlan,
    order: Int,
    imu: ImuOptions,
    mount_deg: int,
    convergence_rad: Float,
    disturbance: Disturbance,
) -> tuple[b.Exterior, Gross]:
    """The exterior table with attitudes; row k is that of image k, station `order[k]` of the plan.

    Parameters
    ----------
    truth : (n, 3, 3) float64
        Rotations of the images to the axes of the block.
    mount_deg : int
        Image x clockwise from the nose.
    convergence_rad : (n,) float64, rad
        Grid north from true north, clockwise.
    """
    n = len(truth)
    sigma = np.radians(np.tile(np.array(disturbance.noise.attitude_deg), (n, 1)))
    errors, gross = disturbance.added("attitude", "attitudes", sigma)
    drift = drift_of_strips(
        plan, np.radians(imu.shift_deg), np.radians(imu.drift_deg_per_s), disturbance.streams["attitude_drift"]
    )[order]
    angles = true_angles(truth, imu, mount_deg, convergence_rad) + drift + errors
    drifting = imu.shift_deg > 0 or imu.drift_deg_per_s > 0
    made = replace(table, angles_rad=angles, angle_sigma_rad=sigma, angle_use=np.full(n, b.OBSERVED_VALUE, np.int32))
    return (replace(made, drift_group=np.array(plan.strip)[order]) if drifting else made), gross


def true_angles(truth: Float, imu: ImuOptions, mount_deg: int, convergence_rad: Float) -> Float:
    """Angles without errors, (n, 3) rad."""
    boresight = Rotation.from_rotvec(np.radians(imu.boresight_deg))
    carried = Rotation.from_matrix(truth) * boresight.inv()
    if imu.rotation == "omega-phi-kappa":
        return np.asarray(carried.as_euler("XYZ"))
    if imu.rotation == "phi-omega-kappa":
        return np.asarray(carried.as_euler("YXZ") * np.array([-1.0, 1.0, 1.0]))
    image = Rotation.from_euler("z", mount_deg, degrees=True) * Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
    north = Rotation.from_matrix(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))
    turn = convergence_rad if imu.heading == "true" else np.zeros(len(truth))
    meridian = Rotation.from_rotvec(np.column_stack([np.zeros((len(truth), 2)), turn]))  # north to the left of the grid
    body = (meridian * north).inv() * carried * image.inv()
    return np.asarray(body.as_euler("ZYX")[:, ::-1])
