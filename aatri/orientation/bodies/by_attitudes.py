"""Images with observed attitudes by all rays, control and positions together, where strips and pairs do not place them.

With the rotation R of the attitudes, boresight included, a ray goes along R (x, y, -c), an observed position lies at
X0 + R a, and the rest is linear (`geometry.known_rotations`). Images and points that are on the ground already are
observed there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Float, diagonals, finite_rows
from aatri.geometry.known_rotations import DirectedRays, ObservedPlaces, places_by_rays
from aatri.geometry.limits import MOST_CENTRES, MOST_POINTS
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import unit
from aatri.observations.attitudes import attitudes_of, boresight_sigma
from aatri.observations.control import control_of
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE, Poses
from aatri.observations.positions import positions_of
from aatri.orientation.bodies.free_body import FreeBody

if TYPE_CHECKING:
    from aatri.orientation.bodies.ground_observed import GroundObserved


def images_by_attitudes(ground: GroundObserved, rays: ImagePointRows, on_ground: Sequence[FreeBody]) -> FreeBody | str:
    """Images with observed attitudes that are not on the ground, as far as all that is observed determines them, and
    points; where there is none why, which is empty if nothing is to be said."""
    block, n = ground.block, len(ground.block.images)
    places, rotation = np.full((n + len(block.points), 3), np.nan), np.full((n, 3, 3), np.nan)
    nowhere, sigma_m = Poses(places[:n], rotation), np.zeros_like(places)
    turned = attitudes_of(
        ObservationSource(block, None, ground.origin_m, {POSE: nowhere}, frame=ground.frame, geodesy=ground.geodesy)
    )
    turned = turned.take(np.flatnonzero(turned.complete))
    sigma_rad = np.hypot(turned.sigma_rad, boresight_sigma(block)[turned.camera])
    rotation[turned.image] = turned.axes @ turned.observed @ exp_rotation(block.cameras.boresight_rad[turned.camera])
    for body in on_ground:
        xyz_m, C = np.append(body.poses.position_m, body.xyz, 0), np.append(body.centre_covariance, body.covariance, 0)
        new = finite_rows(xyz_m)
        places[new], sigma_m[new] = xyz_m[new], np.sqrt(diagonals(C[new]))
        rotation[new[:n]] = body.poses.ground_from_image[new[:n]]
    is_open = finite_rows(rotation) & ~finite_rows(places[:n])
    shown = np.isin(rays.point, rays.point[rays.active & is_open[rays.image]])
    rows = np.flatnonzero(rays.active & shown & finite_rows(rotation)[rays.image])
    if not len(rows):
        return ""
    directed = DirectedRays(
        rays.image[rows].astype(np.int64),
        n + rays.point[rows].astype(np.int64),
        unit(rays.directions(Poses(places[:n], rotation), rows)),
        np.hypot(rays.sigma_mm[rows].mean(axis=1) / rays.c_mm[rows], np.median(sigma_rad)),
    )
    if not directed.few_enough:
        return (
            f"attitudes do not place {int(is_open.sum())} images: with what shares points with them they are too many "
            f"at once (at most {MOST_CENTRES} images and {MOST_POINTS} points)"
        )
    observed = _observed(ground, rotation, places, sigma_m)
    places, covariance = places_by_rays(directed, observed, len(places))
    poses = Poses(places[:n], rotation).where(is_open & finite_rows(places[:n]))
    turn_rad = float(np.median(directed.sigma_rad))
    return FreeBody(poses, places[n:], covariance[n:], covariance[:n], turn_rad) if poses.oriented.any() else ""


def _observed(ground: GroundObserved, rotation: Float, places: Float, sigma_m: Float) -> ObservedPlaces:
    """Places that are known; of others positions and control, reduced to the origin. Images stand before points."""
    n, fixed = len(rotation), finite_rows(places)
    control, positions = control_of(ground.inside), positions_of(ground.inside)
    positions = positions.take(finite_rows(rotation)[positions.image] & ground.use_positions)
    centre_m = positions.position_m - np.einsum("nij,nj->ni", rotation[positions.image], positions.lever_arm_m)
    place = np.append(positions.image, n + control.point.astype(np.int64))
    seen = np.concatenate([positions.given, control.given])
    C = np.concatenate([positions.covariance_m2, control.covariance_m2])
    of_place_m = np.where(seen, np.sqrt(diagonals(C)), np.inf)
    xyz_m = np.where(seen, np.concatenate([centre_m, control.xyz_m]) - ground.origin_m, 0.0)
    new = ~fixed[place]
    return ObservedPlaces(
        np.append(place[new], np.flatnonzero(fixed)),
        np.append(xyz_m[new], places[fixed], 0),
        np.append(of_place_m[new], sigma_m[fixed], 0),
    )
