"""Components of images as bodies, and the points of a free datum that place them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Float, Int, Text, finite_rows
from aatri.codes import CONTROL
from aatri.errors import ConvergenceError, GeometryError
from aatri.ids import shown
from aatri.observations.control import known_at, observed_control
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.ground_observed import NEIGHBOUR, GroundObserved, oriented_by
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.limits import DATUM_SHARE, FREE_DISTANCE_SHARE

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


PRECISION = 3.0
"""Standard deviations of a ray that a point or projection centre of a component is off, in object space."""

ACROSS = 0.1
"""Share of a bend that counts across it: a body is not turned more exactly than by this while it is oriented, and where
its points were known far better across than along, no orientation would settle."""


def body_of(component: ImageComponent, rays: ImagePointRows) -> FreeBody:
    """A component as a body: points and images are as precise as rays of typical length, and as what it bends by."""
    variance = precision(component, rays) ** 2
    of_centres, of_points = (
        np.tile(variance * np.eye(3), (n, 1, 1)) for n in (len(component.images), len(component.xyz))
    )
    for centres, points in component.bends:
        of_centres += _of_bend(centres)
        of_points += _of_bend(points)
    return FreeBody(component.poses, component.xyz, of_points, of_centres, angle_precision(component, rays))


def _of_bend(bend: Float) -> Float:
    """Covariances of what is off by a bend, (n, 3, 3): along it, and across it by `ACROSS`."""
    length = np.linalg.norm(bend, axis=1)[:, None, None]
    return np.asarray(np.einsum("ni,nj->nij", bend, bend) + (ACROSS * length) ** 2 * np.eye(3))


def precision(component: ImageComponent, rays: ImagePointRows) -> float:
    """Standard deviation of points and centres of a component, in its unit: that of a ray at its typical length."""
    rows = np.flatnonzero(component.kept)
    away = component.xyz[rays.point[rows]] - component.poses.position_m[rays.image[rows]]
    per_mm = np.linalg.norm(away, axis=1) / rays.c_mm[rows]
    return PRECISION * component.ray_spread * float(np.median(per_mm * rays.sigma_mm[rows].mean(axis=1)))


def angle_precision(component: ImageComponent, rays: ImagePointRows) -> float:
    """Standard deviation of the rotations of a component, rad: that of a ray."""
    rows = np.flatnonzero(component.kept)
    angle = float(np.median(rays.sigma_mm[rows].mean(axis=1) / rays.c_mm[rows]))
    return PRECISION * component.ray_spread * angle


def observed_at_datum_points(ground: GroundObserved) -> tuple[Text, tuple[Observed, ...]]:
    """Points that a free datum rests on, and their approximate coordinates; none where the block marks none."""
    table, frame = ground.block.ground_points, ground.frame
    xyz = (table.xyz_m if frame is None else frame.from_block(table.xyz_m)) - ground.origin_m
    has_coordinates, chosen = finite_rows(xyz), table.datum & ~(table.role == CONTROL).all(axis=1)
    row = np.flatnonzero(has_coordinates & chosen)
    sigma_m = (
        DATUM_SHARE * float(np.linalg.norm(np.ptp(xyz[has_coordinates], axis=0))) if has_coordinates.any() else 0.0
    )
    if not (len(row) and sigma_m > 0):
        return np.zeros(0, dtype=np.str_), ()
    point = table.point[row]
    ids = ground.block.points.id[point]
    approximate = known_at(point, xyz[row], sigma_m**2 * np.eye(3))
    return ids, observed_control(approximate, np.zeros(3), ids, kind=NEIGHBOUR)


def oriented_at_datum_points(
    ground: GroundObserved, component: ImageComponent, rays: ImagePointRows, settings: OrientationSettings, what: str
) -> tuple[OrientedBody, Text] | str:
    """A component by the points that a free datum rests on, and what is observed, and which points of it these are.

    Else why they do not place it; an empty text where none is marked.
    """
    ids, near = observed_at_datum_points(ground)
    own = ids[np.isin(ids, ground.block.points.id[finite_rows(component.xyz)])]
    reason = "it has none of them"
    try:
        if len(own):
            return oriented_by(replace(ground, beside=near), body_of(component, rays), settings, what)[0], own
    except (ConvergenceError, GeometryError) as error:
        reason = error.what.removeprefix(f"{what}: ")
    text = f"datum points {shown(ids)} do not place {what}: {reason}; mark three or more that are not on one line"
    return text if len(ids) else ""


def open_distances(block: Block) -> list[tuple[Int, Float]]:
    """Cameras whose principal distance is open, (k,), with its standard deviation as a share of it, (n_cameras,).

    Cameras of a single image are taken together, as if all were off by the same share.
    """
    p, images = block.camera_parameters, np.bincount(block.images.camera, minlength=len(block.cameras))
    share = np.zeros(len(block.cameras))
    rows = np.flatnonzero(p.name == "principal_distance")
    sigma = np.nan_to_num(p.sigma[rows]) / block.cameras.principal_distance_mm[p.camera[rows]]
    share[p.camera[rows]] = np.where(p.free[rows], FREE_DISTANCE_SHARE, sigma)
    single, several = np.flatnonzero(images == 1), np.flatnonzero((images > 1) & (share > 0))
    groups = [single] * bool(share[single].any()) + [np.array([k]) for k in several]
    return [(group, share) for group in groups]


def principal_distance_shares(block: Block, rays: ImagePointRows) -> tuple[Float, ...]:
    """Standard deviations of open principal distances over these, ray by ray, for each that is wrong by itself."""
    of_ray = block.images.camera[rays.image]
    return tuple(np.where(np.isin(of_ray, group), share[of_ray], 0.0) for group, share in open_distances(block))
