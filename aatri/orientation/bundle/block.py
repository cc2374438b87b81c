"""What a bundle adjustment takes: observations of all kinds, start values; and what of it can take part.

A coordinate of a point that no observation can see (the height of a point of a plane network, the place of a levelled
one) is absent: no unknown, and no result. An image or point takes part if its start is known, its observations are at
least as many as its free unknowns, and one of them ties it to something else. What does not is left out before the
first iteration, and named; with it go the observations that touch it, so that the rule is applied until nothing
changes, and so for a plane, line ... whose points are fewer than its unknowns. Other unknowns (drift, film, camera ...)
take part if an observation ties them to something else.

Images have camera, strip and flight in common; errors and standard deviations may be common to them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Ids, State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text, finite_rows
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.level import PLANE, Level
from aatri.observations.observed import Holds, Observed
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import POINT, POSE, Poses, point_generator, pose_unknowns
from aatri.orientation.bundle.seen_distances import median_distance_m, seen_distances_m
from aatri.orientation.bundle.strip_numbering import StripNumbering

STRIP, LINE = "strip", "line of flight"


@dataclass(frozen=True)
class ImageGroups:
    """Camera, strip, flight and time of all images."""

    cameras: Text
    """(k,) str. Ids of all cameras."""
    corner_mm: Float
    """(k,), mm. Half the diagonal of their formats; NaN unknown."""
    camera: Int
    """(n,). Of each image, among these."""
    strip: Text
    flight: Text
    """(n,) str. Empty without."""
    time_s: Float
    sequence: Float
    """(n,). Time, and place in the strip."""
    line: str = STRIP
    """What a strip is: one that is declared, or a line that was flown."""


@dataclass(frozen=True)
class BundleInput:
    """A block ready for adjustment: rows are those of all images and points. Coordinates are reduced to the origin."""

    image_ids: Ids
    point_ids: Ids
    observed: tuple[Observed, ...]
    poses: Poses
    """Start; NaN where unknown."""
    xyz_m: Float
    """(n_points, 3), m. Start; NaN where unknown."""
    origin_m: Float
    """(3,), m."""
    rays: ImagePointRows | None = None
    """The image points, from which missing start values are found."""
    parameters: tuple[ParameterRows, ...] = ()
    """What the image points touch beside poses and points."""
    marked: Bool | None = None
    """(n_points,). Points on which a free datum may rest."""
    numbering: StripNumbering | None = None
    """Places of the images for the textbook's orders of elimination; else their positions."""
    images: ImageGroups | None = None
    """What images have in common, where that is known."""
    level: Level = PLANE
    """What is up in the frame of the adjustment."""
    held_images: Bool | None = None
    held_points: Bool | None = None
    """(n,). Images and points that are not adjusted, see `partial`."""
    datum: State | None = None
    """Poses and points onto which a free datum is fitted; NaN and default: those of the start."""


@dataclass(frozen=True)
class Participants:
    """What takes part."""

    start: State
    """Values of all groups of unknowns."""
    of: dict[str, Bool]
    """Dict of str to (n,). Blocks of each group of unknowns."""
    rows: tuple[Int, ...]
    """Tuple of (k,). Rows of each of the observations: used, or rejected and predicted."""
    absent: Bool
    """(n_points, 3). Coordinates of points that no observation can see."""


def taking_part(inputs: BundleInput) -> Participants:
    """Which blocks and observations take part; see above."""
    absent, start = absent_coordinates(inputs.observed, len(inputs.point_ids)), start_of(inputs)
    part = {
        POSE: inputs.poses.oriented,
        POINT: finite_rows(start[POINT]),
    }
    own_unknowns = {u.name: len(u.free) for o in inputs.observed for u in o.unknowns}
    part |= {name: np.ones(n, dtype=bool) for name, n in own_unknowns.items()}
    adjustable = ~_exact_coordinates(inputs.observed, len(part[POINT])) & ~absent
    needed = {POSE: np.full(len(part[POSE]), 6), POINT: adjustable.sum(axis=1)}
    needed |= {u.name: u.free.sum(axis=1) for o in inputs.observed if o.refitted is not None for u in o.unknowns}
    for name, held_blocks in ((POSE, inputs.held_images), (POINT, inputs.held_points)):
        needed[name] = needed[name] if held_blocks is None else np.where(held_blocks, 0, needed[name])
    components = [_components(o.records) for o in inputs.observed]
    while True:
        usable = [_usable(o.records, part) for o in inputs.observed]
        count = {name: np.zeros(len(p), dtype=np.int64) for name, p in part.items()}
        is_tied = {name: np.zeros(len(p), dtype=bool) for name, p in part.items()}
        for o, m, use in zip(inputs.observed, components, usable):
            active = use & o.records.active
            rows: Int | slice = slice(None) if active.all() else np.flatnonzero(active)
            for group, block in o.records.touches:
                of_rows = np.bincount(block[rows], None if isinstance(m, int) else m[rows], len(count[group]))
                count[group] += of_rows.astype(np.int64) * (m if isinstance(m, int) else 1)
                if len(o.records.touches) > 1:
                    is_tied[group][block[rows]] = True
        remaining = {name: p & is_tied[name] for name, p in part.items()}
        for name, least_count in needed.items():
            remaining[name] &= count[name] >= least_count
        if all((remaining[name] == p).all() for name, p in part.items()):
            break
        part = remaining
    rows_of = tuple(
        np.flatnonzero(use & (o.records.active if o.rejected is None else o.records.active | o.rejected))
        for o, use in zip(inputs.observed, usable)
    )
    return Participants(start, part, rows_of, absent & part[POINT][:, None])


def absent_coordinates(observed: Sequence[Observed], n_points: int) -> Bool:
    """Coordinates of points that no observation can see, (n_points, 3)."""
    visible = np.zeros((n_points, 3), dtype=bool)
    if all(np.all(o.sees) for o in observed):
        return visible
    for o in observed:
        sees = np.broadcast_to(o.sees, (len(o), 3))
        for group, block in o.records.touches:
            for k in range(3) if group == POINT else ():
                visible[block[sees[:, k]], k] = True
    touched: Bool = np.asarray(visible.any(axis=1))
    return ~visible & touched[:, None]


def touched_points(inputs: BundleInput) -> Bool:
    """Points that some observation ties to something else, (n_points,)."""
    touched = np.zeros(len(inputs.point_ids), dtype=bool)
    for o in inputs.observed:
        if len(o.records.touches) > 1:
            for group, block in o.records.touches:
                if group == POINT:
                    touched[block[o.records.active]] = True
    return touched


def _components(records: Records) -> int | Int:
    """Observed components of each record, or of all where they are the same."""
    if records.whitener.ndim == 2 and (records.whitener > 0).all():
        return records.rows
    return np.asarray(records.observed_components().sum(axis=1))


def _usable(records: Records, part: Mapping[str, Bool]) -> Bool:
    use = np.ones(len(records.active), dtype=bool)
    for group, block in records.touches:
        use &= part[group][block]
    return use


def _exact_coordinates(observed: Sequence[Observed], n_points: int) -> Bool:
    """Coordinates of points that exact observations fix."""
    exact = np.zeros((n_points, 3), dtype=bool)
    for h in _holds(observed):
        row, scalar = np.nonzero(h.scalar)
        exact[h.block[row], scalar] = True
    return exact


def _holds(observed: Sequence[Observed]) -> list[Holds]:
    return [o.holds for o in observed if o.holds is not None and o.holds.group == POINT]


def start_of(inputs: BundleInput) -> State:
    """Values of all groups of unknowns at the start.

    Exact coordinates of points are at their values, absent ones that have no start at the mean of the others.
    """
    xyz = inputs.xyz_m.copy()
    if not inputs.level.curved:
        finite = np.isfinite(xyz)
        mean = np.where(finite, xyz, 0.0).sum(axis=0) / np.maximum(finite.sum(axis=0), 1)
        xyz = np.where(absent_coordinates(inputs.observed, len(xyz)) & ~finite, mean, xyz)
    for h in _holds(inputs.observed):
        row, scalar = np.nonzero(h.scalar)
        xyz[h.block[row], scalar] = h.value[row, scalar]
    own_values = {name: value for o in inputs.observed for name, value in o.start.items()}
    return {POSE: inputs.poses, **own_values, POINT: xyz}


def unknowns_of(inputs: BundleInput, participants: Participants, poses: Bool, places: Float) -> list[Unknowns]:
    """All groups of unknowns: poses, those of the kinds of observations, and points.

    Parameters
    ----------
    poses : (n_images, 6) bool
        Which scalars of the poses are free.
    places : (n_images, 2) or (n_images, 3) float64
        Where the images lie, for the order of elimination.
    """
    point = participants.of[POINT]
    free = (
        np.repeat(point[:, None], 3, axis=1) & ~_exact_coordinates(inputs.observed, len(point)) & ~participants.absent
    )
    free &= np.True_ if inputs.held_points is None else ~inputs.held_points[:, None]
    groups = []
    if len(poses):
        start = (inputs.rays, inputs.poses, inputs.xyz_m)
        seen_at_m = np.where(with_own_observations(inputs.observed, len(poses)), 0.0, seen_distances_m(*start))
        groups = [pose_unknowns(inputs.image_ids, poses, places, median_distance_m(*start), seen_at_m)]
    for o in inputs.observed:
        groups += [replace(u, free=u.free & participants.of[u.name][:, None]) for u in o.unknowns]
    # Where no image is adjusted, nothing is left to eliminate the points from: they are the unknowns that are kept.
    onto = bool(poses.any()) or inputs.held_images is None
    far = np.full(3, _extent_m(inputs.xyz_m)) if inputs.rays is None else None
    return [
        *groups,
        Unknowns(
            POINT,
            free,
            ("X", "Y", "Z"),
            inputs.point_ids,
            add_step,
            eliminated=onto,
            position=inputs.xyz_m if onto else None,
            generator=point_generator,
            implausible=far,
        ),
    ]


def with_own_observations(observed: Sequence[Observed], n_images: int) -> Bool:
    """Images whose poses are observed, not their points alone, (n_images,)."""
    own = np.zeros(n_images, dtype=bool)
    for o in observed:
        for group, block in o.records.touches:
            if group == POSE and POINT not in o.records.groups:
                own[block[o.records.active]] = True
    return own


def _extent_m(xyz_m: Float) -> float:
    """Extent of a network, m: a point less certain than this is not determined."""
    finite = xyz_m[finite_rows(xyz_m)]
    return float(np.linalg.norm(np.ptp(finite, axis=0))) if len(finite) > 1 else np.inf
