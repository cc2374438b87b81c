"""Images with observed attitudes by all rays, control and positions together, where strips and pairs do not place them.

With the rotation R of the attitudes, boresight included, a ray goes along R (x, y, -c), an observed position lies at
X0 + R a, and the rest is linear (`geometry.known_rotations`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Float, finite_rows
from aatri.geometry.known_rotations import DirectedRays, ObservedPlaces, places_by_rays
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import unit
from aatri.observations.attitudes import attitudes_of
from aatri.observations.control import control_of
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE, Poses
from aatri.observations.positions import positions_of
from aatri.orientation.bodies.free_body import FreeBody

if TYPE_CHECKING:
    from aatri.orientation.bodies.ground_observed import GroundObserved


def images_by_attitudes(ground: GroundObserved, rays: ImagePointRows) -> FreeBody | None:
    """Images with observed attitudes that rays, control and positions determine, and their points; None if none is."""
    block, n = ground.inside, len(ground.inside.images)
    nowhere = Poses(np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan))
    turned = attitudes_of(ObservationSource(block, None, ground.origin_m, {POSE: nowhere}, geodesy=ground.geodesy))
    turned = turned.take(np.flatnonzero(turned.complete))
    if not len(turned.row):
        return None
    rotation, turn_rad = nowhere.ground_from_image, float(np.median(turned.sigma_rad))
    rotation[turned.image] = turned.observed @ exp_rotation(block.cameras.boresight_rad[turned.camera])
    rows = np.flatnonzero(rays.active & np.isin(rays.image, turned.image))
    directed = DirectedRays(
        rays.image[rows].astype(np.int64),
        n + rays.point[rows].astype(np.int64),
        unit(rays.directions(Poses(nowhere.position_m, rotation), rows)),
        np.hypot(rays.sigma_mm[rows].mean(axis=1) / rays.c_mm[rows], turn_rad),
    )
    places, covariance = places_by_rays(directed, _observed(ground, rotation), n + len(block.points))
    poses = Poses(places[:n], rotation).where(finite_rows(places[:n]))
    return FreeBody(poses, places[n:], covariance[n:], covariance[:n], turn_rad) if poses.oriented.any() else None


def _observed(ground: GroundObserved, rotation: Float) -> ObservedPlaces:
    """Positions and control, reduced to the origin; images stand before points."""
    control, positions = control_of(ground.inside), positions_of(ground.inside)
    positions = positions.take(finite_rows(rotation[positions.image]) & ground.use_positions)
    centre_m = positions.position_m - np.einsum("nij,nj->ni", rotation[positions.image], positions.lever_arm_m)
    seen = np.concatenate([positions.given, control.given])
    C = np.concatenate([positions.covariance_m2, control.covariance_m2])
    sigma_m = np.where(seen, np.sqrt(np.einsum("nii->ni", C)), np.inf)
    xyz_m = np.where(seen, np.concatenate([centre_m, control.xyz_m]) - ground.origin_m, 0.0)
    return ObservedPlaces(np.append(positions.image, len(rotation) + control.point.astype(np.int64)), xyz_m, sigma_m)
