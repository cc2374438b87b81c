"""A free component of images and points as one body of seven unknowns, and the observations that concern it.

The points that an observation touches are tied to the body by their covariances (`similarity_ties`), projection centres
likewise, and the rotations of their images by

    v = log(R_image (R R_k)'),      dv/dd = J(v)^-1 = -dv/dr exp(-[v]x)

with R the rotation of the body, R_k that of the image in the body, J the left Jacobian of the rotation group. So any
kind of observation (`observations.kinds`) that touches points and images observes the body through them.

Source: docs/formulas.md 5.6; Sola 2018 for J.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjusting.added_variance import observed_components
from aatri.adjusting.limits import UNCERTAIN_DISTANCE
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int, Text, finite_rows
from aatri.geometry.rotations import exp_rotation, left_jacobian, log_rotation, skew
from aatri.geometry.similarity import Similarity, compose, motions_about, transform, transform_covariance
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.ties import BODY, COMPONENT_CENTRE, COMPONENT_POINT, COMPONENT_ROTATION, HELD
from aatri.orientation.bodies.similarity_ties import similarities_of, similarity_ties

LEVELLED = "levelled"

HELD_SIGMA = 1e-6
"""Standard deviation of what is held where the datum is free, as a share of the extent of the body, or rad."""

LEVEL_RAD = 0.1
"""By how much the images of a strip are tilted in the mean, where nothing else tells: near-vertical photographs stay
below 3 to 5 degrees (Kraus, Photogrammetry); from steeper ones none begins."""

WIDEST = 3
"""Components of a record, at most, that takes part; those of many that are correlated are for the bundle."""


@dataclass(frozen=True)
class FreeBody:
    """A component of images and points in a frame of its own; rows are those of all images and points of the block."""

    poses: Poses
    """NaN where it has no image."""
    xyz: Float
    """(n_points, 3). NaN where it has no point."""
    covariance: Float
    """(n_points, 3, 3). Of the points."""
    centre_covariance: Float
    """(n_images, 3, 3). Of the projection centres."""
    turn_rad: float
    """Standard deviation of the rotations of the images."""

    @property
    def has(self) -> dict[str, Bool]:
        """Which images and points it has, by the names of their groups."""
        return {POSE: finite_rows(self.poses.position_m), POINT: finite_rows(self.xyz)}

    @property
    def places(self) -> Float:
        """Projection centres and points, but those at infinity, which would decide what a change of scale moves."""
        centres = self.poses.position_m[self.has[POSE]]
        points = np.flatnonzero(self.has[POINT])
        near = at_a_distance(self.xyz[points], self.covariance[points], centres)
        return np.concatenate([self.xyz[points[near]], centres])

    @property
    def up(self) -> Float:
        """Direction against the mean viewing direction of its images."""
        return np.asarray(self.poses.ground_from_image[self.has[POSE]][:, :, 2].mean(axis=0))

    def moved(self, to: Similarity) -> "FreeBody":
        """The same after a similarity."""
        placed = self.on_ground(to)
        of_points, of_centres = (transform_covariance(to, C) for C in (self.covariance, self.centre_covariance))
        return FreeBody(placed[POSE], placed[POINT], of_points, of_centres, self.turn_rad)

    def on_ground(self, to: Similarity) -> dict[str, Any]:
        """Its images and points after a similarity, as a state of unknowns."""
        poses = Poses(transform(to, self.poses.position_m), to.rotation @ self.poses.ground_from_image)
        return {POSE: poses, POINT: transform(to, self.xyz)}


def at_a_distance(xyz: Float, covariance: Float, centres: Float) -> Bool:
    """Which points are none at infinity, (n,): known to a share `UNCERTAIN_DISTANCE` of their median distance from the
    images.

    The own distance of a point at infinity, as uncertain, says nothing.

    Parameters
    ----------
    xyz, covariance : (n, 3), (n, 3, 3) float64
    centres : (m, 3) float64
        Projection centres.
    """
    spread = np.sqrt(np.einsum("nii->n", covariance))
    return np.asarray(spread < UNCERTAIN_DISTANCE * np.median(np.linalg.norm(xyz - centres.mean(axis=0), axis=1)))


def concerning(observed: Iterable[Observed], body: FreeBody) -> tuple[Observed, ...]:
    """Observations of nothing but images and points of a body, with the unknowns of their own that they determine.

    What is known beforehand of these unknowns, and is not tested, comes last.
    """
    has, kept = body.has, list[Observed]()
    unknowns = {u.name: u for o in observed for u in o.unknowns}
    start = {name: value for o in observed for name, value in o.start.items()}
    for o in observed:
        inside = np.asarray(o.records.active & (o.records.rows <= WIDEST))
        for group, block in o.records.touches:
            inside &= has[group][block] if group in has else True
        kept.append(replace(o.take(np.flatnonzero(inside)), unknowns=(), start={}))
    while True:
        determined = {name: _determined(u, kept) for name, u in unknowns.items()}
        drop = [_touching(o, {name: ~use for name, use in determined.items()}) for o in kept]
        if not any(rows.any() for rows in drop):
            break
        kept = [o.take(np.flatnonzero(~rows)) for o, rows in zip(kept, drop)]
    of_body = sorted((o for o in kept if len(o)), key=lambda o: bool(o.components))
    own = tuple(
        replace(u, free=u.free & determined[name][:, None]) for name, u in unknowns.items() if determined[name].any()
    )
    if of_body and own:
        of_body[0] = replace(of_body[0], unknowns=own, start={u.name: start[u.name] for u in own})
    return tuple(of_body)


def _determined(u: Unknowns, observed: Sequence[Observed]) -> Bool:
    """Blocks of unknowns that as many components touch as they have free scalars, priors among them, and others."""
    count, others = np.zeros(len(u.free)), np.zeros(len(u.free), dtype=bool)
    for o in observed:
        for group, block in o.records.touches:
            if group == u.name:
                count += np.bincount(block, observed_components(o).sum(axis=1), len(u.free))
                if len(o.records.touches) > 1:
                    others[block] = True
    return np.asarray(others & (count >= u.free.sum(axis=1)))


def _touching(o: Observed, blocks: dict[str, Bool]) -> Bool:
    """Rows that touch some blocks, (n,)."""
    touches = np.zeros(len(o), dtype=bool)
    for group, block in o.records.touches:
        if group in blocks:
            touches |= blocks[group][block]
    return touches


def state_of(observed: Iterable[Observed], body: FreeBody, to: Similarity) -> State:
    """A body on the ground, with the start of the unknowns that observations of it have of their own."""
    return {**{name: value for o in observed for name, value in o.start.items()}, **body.on_ground(to)}


def touched(observed: Iterable[Observed], group: str) -> Int:
    """Blocks of a group that observations touch, ascending."""
    blocks = [block for o in observed for name, block in o.records.touches if name == group]
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int32), *blocks]))


def ties_of(
    body: FreeBody, observed: Sequence[Observed], start: Similarity, what: str, image_ids: Text, point_ids: Text
) -> tuple[list[Observed], Float]:
    """Ties of what observations touch to their body, and the place in it to which they are reduced.

    Parameters
    ----------
    start : Similarity
        Ground from body.
    what : str
        What messages call the body.
    image_ids, point_ids : (n,) str
    """
    images, points = touched(observed, POSE), touched(observed, POINT)
    places = np.concatenate([body.poses.position_m[images], body.xyz[points]])
    centre = places.mean(axis=0) if len(places) else np.zeros(3)
    begin = similarities_of([compose(start, Similarity(centre, 1.0, np.eye(3)))])
    parts = (
        (COMPONENT_POINT, POINT, points, body.xyz[points], body.covariance[points], point_ids),
        (COMPONENT_CENTRE, POSE, images, body.poses.position_m[images], body.centre_covariance[images], image_ids),
    )
    ties_observed = list[Observed]()
    for kind, group, block, x, covariance, ids in parts:
        if len(block):
            ties = similarity_ties(
                np.zeros(len(block), dtype=np.int32), block, x - centre, covariance, names=[what], group=group
            )
            ties_observed.append(ties.observed(kind, np.full(len(block), what), ids[block], begin))
    if len(images):
        ties_observed.append(
            _rotation_ties(images, body.poses.ground_from_image[images], body.turn_rad, image_ids[images])
        )
    return ties_observed, centre


def _rotation_ties(image: Int, rotation: Float, sigma_rad: float, names: Text) -> Observed:
    """Rotations of images of the one body, (n, 3, 3), as what is known of them beforehand: they are not tested."""

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        bodies: Any = state[BODY]
        v, by_image = _turned(state, image[rows], bodies.rotation[0] @ rotation[rows])
        by_body = np.zeros((len(rows), 3, 7))
        by_body[:, :, 3:6] = -by_image[:, :, 3:] @ exp_rotation(v)
        return v, (by_image, by_body)

    n = len(image)
    touches = ((POSE, image.astype(np.int32)), (BODY, np.zeros(n, dtype=np.int32)))
    records = Records(COMPONENT_ROTATION, touches, evaluate, np.full((n, 3), 1.0 / sigma_rad), np.ones(n, dtype=bool))
    about = ("rotation about X", "rotation about Y", "rotation about Z")
    return Observed(records, np.full(n, -1), named(names), "rad", components=about)


def levelled(image: Int, sigma_rad: float, names: Text) -> Observed:
    """That images look down, as what is known of them beforehand: v = (R e)_xy with e the camera's axis, (n, 2)."""

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        axis = state[POSE].ground_from_image[image[rows]][:, :, 2]
        by_image = np.zeros((len(rows), 2, 6))
        by_image[:, :, 3:] = -skew(axis)[:, :2]
        return axis[:, :2], (by_image,)

    n = len(image)
    touches, whitener = ((POSE, image.astype(np.int32)),), np.full((n, 2), 1.0 / sigma_rad)
    records = Records(LEVELLED, touches, evaluate, whitener, np.ones(n, dtype=bool))
    return Observed(records, np.full(n, -1), named(names), "rad", components=("level X", "level Y"))


def observed_rotations(kind: str, image: Int, rotation: Float, sigma_rad: float, names: Text) -> Observed:
    """Rotations of images, (n, 3, 3), as observations, v = log(R_image R')."""

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        v, by_image = _turned(state, image[rows], rotation[rows])
        return v, (by_image,)

    n = len(image)
    touches, whitener = ((POSE, image.astype(np.int32)),), np.full((n, 3), 1.0 / sigma_rad)
    records = Records(kind, touches, evaluate, whitener, np.ones(n, dtype=bool))
    return Observed(records, np.full(n, -1), named(names), "rad")


def _turned(state: State, image: Int, rotation: Float) -> tuple[Float, Float]:
    """By how much images are turned against rotations, and its derivatives by their poses."""
    v = log_rotation(state[POSE].ground_from_image[image] @ rotation.swapaxes(1, 2))
    by_image = np.zeros((len(image), 3, 6))
    by_image[:, :, 3:] = np.linalg.inv(left_jacobian(v))
    return v, by_image


def held_motions(motions: Float, body: FreeBody, start: Similarity, centre: Float) -> Observed:
    """What is open of a body, held where it is: no residual changes by it.

    Parameters
    ----------
    motions : (7, d) float64
        Shift, rotation and change of scale about the origin.
    centre : (3,) float64
        In the body, about which its unknowns turn it.
    """
    middle = transform(start, centre[None])[0]
    extent = float(np.linalg.norm(transform(start, body.places) - middle, axis=1).max())
    along = np.linalg.qr((motions_about(-middle) @ motions) / np.array([[extent]] * 3 + [[1.0]] * 4))[0].T
    along[:, :3] /= extent

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        current: Similarity = state[BODY][0]
        turned = log_rotation((current.rotation @ start.rotation.T)[None])[0]
        moved = np.concatenate([current.translation - middle, turned, [np.log(current.scale / start.scale)]])
        return (along @ moved)[None, :][rows], (along[None][rows],)

    n = len(along)
    whitener, touches = np.full((1, n), 1.0 / HELD_SIGMA), ((BODY, np.zeros(1, dtype=np.int32)),)
    records = Records(HELD, touches, evaluate, whitener, np.ones(1, dtype=bool))
    labels = tuple(f"open motion {k + 1}" for k in range(n))
    return Observed(records, np.array([-1]), named(np.array([HELD])), "", components=labels)
