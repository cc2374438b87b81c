"""A free component of strips on the ground: what is known of it as a datum, and its similarity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.ground.absolute_tables import Ground, OrientedPart
from aatri.adapters.ground.initial_observed import SeenAttitudes
from aatri.adapters.strips import strips as pieces
from aatri.arrays import Float, Int
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import staying_out
from aatri.errors import GeometryError
from aatri.geometry.similarity import transform
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.absolute import orient_component
from aatri.orientation.bodies.components import Component
from aatri.orientation.bodies.datum import Datum
from aatri.orientation.bodies.deformation import expected_ratio
from aatri.orientation.bodies.given_relations import GivenAttitudes

UNCERTAIN = 0.1
"""Share of its distance by which a point at infinity, of parallel rays, is uncertain: no part of what is oriented."""


def oriented_part(
    ground: Ground, component: Component, what: str, limit: float, *, two_points: bool
) -> tuple[OrientedPart, list[Note]]:
    """A component by control and positions; by attitudes as well where these leave something open.

    Raises
    ------
    GeometryError
        If something is not determined.
    """
    centres, rotations, image = free_images(ground.strips, component)
    row_of = np.full(len(ground.block.images), -1)
    row_of[image] = np.arange(len(image))
    control, positions = ground.control, ground.positions
    held = np.flatnonzero(np.isin(control.point, component.point))
    at = np.searchsorted(component.point, control.point[held])
    seen = np.flatnonzero(row_of[positions.image] >= 0)
    station = row_of[positions.image[seen]]
    # A projection centre is about as uncertain as a typical point of the component.
    typical = float(np.median(np.einsum("nii->n", component.covariance))) / 3
    ids = ground.block.points.id[control.point[held]], ground.block.images.id[positions.image[seen]]
    datum = Datum(
        name=tuple(f"point {p}" for p in ids[0]) + tuple(f"image {i}" for i in ids[1]),
        x=np.concatenate([component.xyz[at], centres[station]]),
        covariance=np.concatenate([component.covariance[at], np.tile(typical * np.eye(3), (len(seen), 1, 1))]),
        offset_m=np.concatenate(
            [np.zeros((len(held), 3)), np.einsum("nij,nj->ni", rotations[station], positions.lever_arm_m[seen])]
        ),
        xyz_m=np.concatenate([control.xyz_m[held], positions.position_m[seen]]) - ground.origin,
        covariance_m2=np.concatenate([control.covariance_m2[held], positions.covariance_m2[seen]]),
        given=np.concatenate([control.given[held], positions.given[seen]]),
        n_control=len(held),
        row=np.concatenate([control.row[held], positions.row[seen]]),
        id=np.concatenate(ids),
    )
    before = ground.strips.suspects.take(np.flatnonzero(staying_out(ground.strips.suspects)))
    kinds = ((CONTROL, control.row[held]), (POSITION, positions.row[seen]))
    began = ~np.concatenate([np.isin(row, before.row[before.kind == kind]) for kind, row in kinds])
    spread = np.sqrt(np.einsum("nii->n", component.covariance))
    near = spread < UNCERTAIN * np.linalg.norm(component.xyz - centres.mean(axis=0), axis=1)
    body = np.concatenate([component.xyz[near], centres])
    up = rotations[:, :, 2].mean(0)
    notes = list[Note]()
    try:
        result = orient_component(datum, body, up, what=what, active=began, limit=limit, two_points=two_points)
    except GeometryError as error:
        if ground.attitudes is None or not len(of := np.flatnonzero(row_of[ground.attitudes.image] >= 0)):
            raise
        attitudes = _attitudes(ground, ground.attitudes.take(of), component, row_of, rotations, centres)
        with_them = replace(datum, attitudes=attitudes)
        result = orient_component(with_them, body, up, what=what, active=began, limit=limit)
        text = f"{what}: attitudes of {len(of)} images take part, as control and positions leave it open: {error.what}"
        notes.append(Note("note", text))
    return OrientedPart(what, component, held, seen, result), notes


def _attitudes(
    ground: Ground, a: SeenAttitudes, component: Component, row_of: Int, rotations: Float, centres: Float
) -> GivenAttitudes:
    """Attitudes of images of a component, which is turned within itself by its deformation.

    A strip of n models is off by `expected_ratio` times the standard deviation of a point, over its distance.
    """
    table = ground.strips.strip_images
    models = int(np.bincount(table.strip[np.isin(table.strip, component.strips)]).max(initial=1))
    point = float(np.sqrt(np.median(np.einsum("nii->n", component.covariance)) / 3))
    turned = expected_ratio(models) * point / pieces.distance_m(centres, component.xyz)
    back = np.linalg.inv(a.turning)
    own = turned**2 * back @ back.swapaxes(1, 2)
    return GivenAttitudes("attitude", a.row, ground.block.images.id[a.image], rotations[row_of[a.image]],
                          a.ground_from_image, a.turning, a.covariance_rad2 + own)  # fmt: skip


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
