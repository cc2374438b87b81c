"""What bodies with points and images in common tell of each other where each has too little of its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from aatri.geometry.similarity import Similarity
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.control import known_at, observed_control
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import Positions, observed_positions
from aatri.orientation.bodies.free_body import FreeBody, observed_rotations
from aatri.orientation.bodies.ground_observed import NEIGHBOUR, GroundObserved, everything
from aatri.orientation.bodies.joint_start import joint_start

Part = TypeVar("Part")


def beside_neighbours(ground: GroundObserved, neighbours: Sequence[FreeBody], body: FreeBody) -> GroundObserved:
    """With the images and points that a body shares with others, as these have them; each by the first of them.

    Parameters
    ----------
    neighbours : sequence of FreeBody
        On the ground, reduced to the origin.
    body : FreeBody
        In a frame of its own.
    """
    block, has, observed = ground.block, body.has, list[Observed]()
    images, points = has[POSE], has[POINT]
    for other in neighbours:
        has = other.has
        image, point = np.flatnonzero(images & has[POSE]), np.flatnonzero(points & has[POINT])
        images, points = images & ~has[POSE], points & ~has[POINT]
        places, ids = known_at(point, other.xyz[point], other.covariance[point]), block.images.id[image]
        observed += observed_control(places, np.zeros(3), block.points.id[point], kind=NEIGHBOUR)
        if len(image):
            arm, variances = np.zeros((len(image), 3)), other.centre_covariance[image]
            none = np.full(len(image), -1, dtype=np.int32)
            centres = Positions(none, image.astype(np.int32), other.poses.position_m[image], variances, arm)
            observed += observed_positions(centres, np.zeros(3), ids)
            turned = other.poses.ground_from_image[image]
            observed.append(observed_rotations(ATTITUDE, image, turned, other.turn_rad, ids))
    return replace(ground, beside=(*ground.beside, *observed))


def determined_together(
    ground: GroundObserved, placed_bodies: Sequence[FreeBody], bodies: Sequence[FreeBody]
) -> dict[int, Similarity]:
    """Ground from body of those of `bodies` that are determined by what they share and control together, by number."""
    beside = [beside_neighbours(ground, placed_bodies, body) for body in bodies]
    observes = [seen.of(body, everything, attitudes=True, drift=False) for seen, body in zip(beside, bodies)]
    left, to = [k for k, body in enumerate(bodies) if body.has[POINT].any()], dict[int, Similarity]()
    while left:
        group, placed_here = joint_start([bodies[k] for k in left], [observes[k] for k in left])
        if len(group) > 1 or beside[left[group[0]]].beside:  # what others do not help stays as it is
            to |= {left[k]: similarity for k, similarity in placed_here.items()}
        left = [k for number, k in enumerate(left) if number not in group]
    return to


def oriented_together(
    ground: GroundObserved,
    placed_bodies: Sequence[FreeBody],
    bodies: Sequence[FreeBody],
    oriented: Callable[[int, Mapping[int, Similarity]], Part | None],
) -> dict[int, Part]:
    """Bodies that only together are determined, by number; each at last by what it shares with the others.

    The others are not where one put them that contradicts them: without it all are begun anew.

    Parameters
    ----------
    oriented : callable
        Number of a body, and where the others of `bodies` begin -> the body; None where it contradicts them.
    """
    left = [*range(len(bodies))]
    while True:
        begun = determined_together(ground, placed_bodies, [bodies[k] for k in left])
        to = {left[number]: similarity for number, similarity in begun.items()}
        parts = {k: oriented(k, {other: s for other, s in to.items() if other != k}) for k in to}
        if not (failed := [k for k, part in parts.items() if part is None]):
            return {k: part for k, part in parts.items() if part is not None}
        left = [k for k in left if k not in failed]
