"""A free component of strips on the ground: what is known of it as a datum, and its similarity."""

from __future__ import annotations

import numpy as np

from aatri.adapters.ground.absolute_tables import GroundOfStrips, OrientedPart
from aatri.adapters.ground.initial_datum import Known, datum_of, known_of, without_drifting
from aatri.adapters.strips import oriented_strips as pieces
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import staying_out
from aatri.errors import GeometryError
from aatri.geometry.similarity import transform
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.poses import Poses
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.absolute import OrientedComponent, orient_component
from aatri.orientation.bodies.components import Component
from aatri.orientation.bodies.datum import Datum, FreeBody
from aatri.orientation.bodies.deformation import expected_ratio

UNCERTAIN = 0.1
"""Share of its distance by which a point at infinity, of parallel rays, is uncertain: no part of what is oriented."""


def oriented_part(
    ground: GroundOfStrips, component: Component, what: str, limit: float, *, two_points: bool
) -> tuple[OrientedPart, list[Note]]:
    """A component by control and positions; by attitudes as well where these leave something open.

    Positions of drift groups take part only where nothing else determines the component.

    Raises
    ------
    GeometryError
        If something is not determined.
    """
    body = _body(ground.block, ground.strips, component)
    known = known_of(ground, body)
    steady = without_drifting(ground.block, ground, known)
    if steady.placed and len(steady.position) < len(known.position):
        try:
            return _by_known(ground, component, body, steady, what, limit, two_points=two_points)
        except GeometryError:
            pass  # it hangs on the positions that drift
    return _by_known(ground, component, body, known, what, limit, two_points=two_points)


def _by_known(
    ground: GroundOfStrips,
    component: Component,
    body: FreeBody,
    known: Known,
    what: str,
    limit: float,
    *,
    two_points: bool,
) -> tuple[OrientedPart, list[Note]]:
    block, strips = ground.block, ground.strips
    datum = datum_of(block, ground, body, known)
    before = strips.suspects.take(np.flatnonzero(staying_out(strips.suspects)))
    kinds = ((CONTROL, ground.control.row[known.control]), (POSITION, ground.positions.row[known.position]))
    began = ~np.concatenate([np.isin(row, before.row[before.kind == kind]) for kind, row in kinds])
    centres = body.poses.position_m[body.images]
    spread = np.sqrt(np.einsum("nii->n", component.covariance))
    near = spread < UNCERTAIN * np.linalg.norm(component.xyz - centres.mean(axis=0), axis=1)
    places = np.concatenate([component.xyz[near], centres])

    def by(datum: Datum, *, two_points: bool = False) -> OrientedComponent:
        return orient_component(datum, places, body.up, what=what, active=began, limit=limit, two_points=two_points)

    notes = list[Note]()
    try:
        result = by(datum, two_points=two_points)
    except GeometryError as error:
        if not len(known.attitude):
            raise
        result = by(datum_of(block, ground, body, known, attitudes=True))
        text = f"{what}: attitudes of {len(known.attitude)} images take part, as control and positions leave it open: "
        notes.append(Note("note", text + error.what))
    return OrientedPart(what, component, known.control, known.position, result), notes


def _body(block: Block, strips: Strips, component: Component) -> FreeBody:
    """A component of strips; a projection centre is about as uncertain as a typical point of it.

    It is turned within itself by its deformation: a strip of n models is off by `expected_ratio` times the standard
    deviation of a point, over its distance.
    """
    centres, rotations, image = free_images(strips, component)
    n, m = len(block.images), len(block.points)
    poses = Poses(np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan))
    poses.position_m[image], poses.ground_from_image[image] = centres, rotations
    xyz, covariance = np.full((m, 3), np.nan), np.full((m, 3, 3), np.nan)
    xyz[component.point], covariance[component.point] = component.xyz, component.covariance
    typical = float(np.median(np.einsum("nii->n", component.covariance))) / 3
    table = strips.strip_images
    models = int(np.bincount(table.strip[np.isin(table.strip, component.strips)]).max(initial=1))
    turned = expected_ratio(models) * np.sqrt(typical) / pieces.distance_m(centres, component.xyz)
    return FreeBody(poses, xyz, covariance, typical, float(turned))


def free_images(strips: Strips, component: Component) -> tuple[Float, Float, Int]:
    """Projection centres and rotations of a component's images, in its frame; rows in images."""
    table = strips.strip_images
    rows = np.flatnonzero(np.isin(table.strip, component.strips))
    centres, rotations = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for strip, pose in zip(component.strips, component.component_from_strip):
        of = table.strip[rows] == strip
        centres[of] = transform(pose, table.position[rows[of]])
        rotations[of] = pose.rotation @ table.strip_from_image[rows[of]]
    return centres, rotations, table.image[rows].astype(np.int64)
