"""Epochs of one object: the same ground, stations and points under other errors, some points moved."""

import zlib
from dataclasses import replace

import numpy as np

from aatri.errors import InputError
from aatri.simulation.points import GroundTargets
from aatri.simulation.rays import Photography, taken
from aatri.simulation.settings import EpochOptions, refused

OF_THE_OBJECT = ("terrain", "flight", "points", "structure")
"""Random streams that all epochs of a site share."""


def streams_of_site(site: str) -> dict[str, np.random.Generator]:
    """Random streams of the object, from the name of the site alone; none without a name."""
    if not site:
        return {}
    return dict(zip(OF_THE_OBJECT, np.random.default_rng(zlib.crc32(site.encode())).spawn(len(OF_THE_OBJECT))))


def with_moved_points(
    points: GroundTargets, photography: Photography, epoch: EpochOptions, rng: np.random.Generator
) -> GroundTargets:
    """The points with some of the new ones moved in a random direction, photographed where they are now.

    Raises
    ------
    InputError
        If more points are to move than there are new ones.
    """
    if not epoch.moved:
        return points
    new = np.flatnonzero((points.role == 0).all(axis=1) & ~points.in_structure)
    if epoch.moved > len(new):
        raise refused(
            f"{epoch.moved} points are to move, the block has {len(new)} new points",
            "move fewer",
            InputError,
            option="epoch.moved",
        )
    chosen = rng.choice(new, epoch.moved, replace=False)
    direction = rng.standard_normal((epoch.moved, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    local_m = points.local_m.copy()
    local_m[chosen] += direction * rng.uniform(*epoch.moved_m, epoch.moved)[:, None]
    return replace(points, local_m=local_m, rays=taken(photography, local_m))
