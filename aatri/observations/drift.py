"""Positions with unknowns of their own: shift and drift, lever arm, exposure-time offset.

    v = D (X0 + R a - X_observed) + s + (t - t_mean) d + u dt
    dv/ds = I,   dv/dd = (t - t_mean) I,   dv/da = D R,   dv/d(dt) = u

D turns into the axes of the block (`positions`), along which shift and drift run. s is the shift and d the drift per
unit of time that the positions of a group, of the block, of a strip or of a flight share, both free along the
coordinates that its positions give; t is the time of
exposure in seconds, where a group has none the sequence of its images; t_mean the mean over the group. A group whose
images have one time has no drift. The lever arm a is unknown where the block says so (`carried_vectors`), dt where the
options do (`exposure_time`). Differences of the positions of a group, with their correlations, say the same as the
positions with a free shift: `drift: shift`.

Source: Ackermann 1984, Friess 1986; docs/formulas.md 5.3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import ANTENNA
from aatri.geometry.rotations import skew
from aatri.notes import Note
from aatri.observations.carried_vectors import ARMS, LEVER_ARM
from aatri.observations.exposure_time import offset_unknowns, velocities
from aatri.observations.given_coordinates import GivenCoordinates, given_coordinates, in_own_axes
from aatri.observations.observed import Given, Observed, named
from aatri.observations.parameters import uses_of_vector
from aatri.observations.poses import POSE
from aatri.observations.positions import (
    PositionOptions,
    Positions,
    drift_groups,
    position_records,
    positions_of,
    with_unknowns,
)

if TYPE_CHECKING:
    from aatri.artifacts.block import Images

DRIFT = "drift"

USES = ("exterior.drift_group", *uses_of_vector(ARMS.name))


@dataclass(frozen=True)
class Term:
    """Unknowns that some positions touch.

    Attributes
    ----------
    unknowns : Unknowns
    start : (n_blocks, k) float64
    block : (n,) int
        Block of each position; -1 none.
    basis : (n, 3, k) float64, optional
        Derivatives; None for the lever arm, whose derivatives are those of the camera's axes.
    """

    unknowns: Unknowns
    start: Float
    block: Int
    basis: Float | None = None


def drift(given: Given, options: PositionOptions) -> tuple[Observed, ...]:
    """Observed positions of the block that have unknowns of their own."""
    block = given.block
    found = positions_of(block)
    rows = np.flatnonzero(with_unknowns(block, found, options))
    if not len(rows) or not options.use:
        return ()
    found = found.take(rows)
    terms, names = terms_of(given, found, options), block.images.id[found.image]
    coordinates = given_coordinates(given, found.position_m, found.given)
    observed = observed_terms(found, given.origin_m, terms, names, coordinates)
    if options.drift == "linear":
        notes = time_notes(block.images, found.image, drift_groups(block, found, options))
        observed = (replace(observed[0], notes=notes), *observed[1:])
    touched = {group for o in observed for group, _ in o.records.touches}
    if LEVER_ARM not in touched:
        return observed
    return (*observed, *ARMS.priors(block, block.cameras.lever_arm_m, ARMS.unknowns(block)))


def terms_of(given: Given, found: Positions, options: PositionOptions) -> list[Term]:
    """The unknowns of some positions."""
    block, terms = given.block, []
    group = drift_groups(block, found, options)
    if (group != "").any():
        time = group_times(block.images.time_s[found.image], block.images.sequence[found.image], group)
        terms.append(drift_term(group, time, found.given, linear=options.drift == "linear"))
    camera = block.images.camera[found.image]
    armed = np.asarray(ARMS.open(block)[0].any(axis=1))[camera] & (block.exterior.refers_to[found.row] == ANTENNA)
    if armed.any():
        terms.append(Term(ARMS.unknowns(block), block.cameras.lever_arm_m.copy(), np.where(armed, camera, -1)))
    if options.time_offset:
        u = velocities(block, found.image, found.position_m)
        terms.append(Term(offset_unknowns(block), np.zeros((len(block.cameras), 1)), camera, u[:, :, None]))
    return terms


def drift_term(group: Text, time: Float, given: Bool | None = None, *, linear: bool = True) -> Term:
    """Shift and drift of groups, along the coordinates that are `given` (n, 3); an empty name has none."""
    ids = np.unique(group[group != ""])
    block = np.where(group != "", np.searchsorted(ids, group), -1)
    basis = np.concatenate([np.broadcast_to(np.eye(3), (len(group), 3, 3)), time[:, None, None] * np.eye(3)], axis=2)
    free = free_drift(block, len(ids), time, np.ones((len(group), 3), bool) if given is None else given, linear=linear)
    labels = ("shift X", "shift Y", "shift Z", "drift X", "drift Y", "drift Z")
    return Term(Unknowns(DRIFT, free, labels, ids, add_step), np.zeros((len(ids), 6)), block, basis)


def free_drift(block: Int, n: int, time: Float, given: Bool, *, linear: bool = True) -> Bool:
    """Which shifts and drifts of n groups have something to be found from, (n, 6); rows of no group have block -1.

    A drift needs two times among the values of its coordinate.
    """
    free = np.zeros((n, 6), dtype=bool)
    for k in range(3):
        some = np.flatnonzero((block >= 0) & given[:, k])
        first, last = np.full(n, np.inf), np.full(n, -np.inf)
        np.minimum.at(first, block[some], time[some])
        np.maximum.at(last, block[some], time[some])
        free[:, k], free[:, 3 + k] = np.isfinite(first), linear & (last > first)
    return free


def group_times(time_s: Float, sequence: Float, group: Text) -> Float:
    """Times reduced to the mean of their group, (n,): seconds, or the sequence where a group lacks times."""
    found = np.zeros(len(group))
    for name in np.unique(group):
        mine = group == name
        t = time_s[mine] if np.isfinite(time_s[mine]).all() else sequence[mine]
        if np.isfinite(t).all():
            found[mine] = t - t.mean()
    return found


def time_notes(images: Images, image: Int, group: Text) -> tuple[Note, ...]:
    """What the times of drift groups should not say: one time for all, or another order than the sequence.

    Parameters
    ----------
    images : Images
        Of the block.
    image : (n,) int
        Rows of images that belong to the groups (n,).
    """
    time, one, permuted = group_times(images.time_s[image], images.sequence[image], group), list[str](), list[str]()
    for name in np.unique(group[group != ""]).tolist():
        mine = np.flatnonzero(group == name)
        if len(mine) > 1 and np.ptp(time[mine]) == 0:
            one.append(name)
        for strip in np.unique(images.strip[image[mine]]):
            rows = mine[(images.strip[image[mine]] == strip) & np.isfinite(images.sequence[image[mine]])]
            steps = np.diff(time[rows[np.argsort(images.sequence[image[rows]], kind="stable")]])
            if strip >= 0 and (steps > 0).any() and (steps < 0).any() and name not in permuted:
                permuted.append(name)
    told = (
        (one, "drift groups whose images have one time, or no time and no sequence: a shift is estimated, no drift"),
        (permuted, "drift groups whose times do not run with the sequence of their strip: the drift goes by the times"),
    )
    return tuple(Note("warning", text, tuple(names)) for names, text in told if names)


def observed_terms(
    rows: Positions, origin_m: Float, terms: list[Term], names: Text, coordinates: GivenCoordinates | None = None
) -> tuple[Observed, ...]:
    """Positions with their unknowns; those that touch the same kinds of unknowns, weighted or exact, are together."""
    given = in_own_axes(rows.position_m, origin_m, rows.given) if coordinates is None else coordinates
    touched = np.stack([t.block >= 0 for t in terms], axis=1)
    found, told = [], set[str]()
    for pattern in np.unique(touched, axis=0)[::-1]:
        for exact, chosen in rows.by_exactness():
            some = chosen[(touched[chosen] == pattern).all(axis=1)]
            if not len(some):
                continue
            mine = [_taken(t, some) for t, has in zip(terms, pattern) if has]
            new = [t for t in mine if t.unknowns.name not in told]
            told |= {t.unknowns.name for t in new}
            records = _records(rows.take(some), given.take(some), mine, exact=exact)
            found.append(
                Observed(
                    records,
                    rows.row[some],
                    named(image=names[some]),
                    "m",
                    exact=exact,
                    unknowns=tuple(t.unknowns for t in new),
                    start={t.unknowns.name: t.start for t in new},
                )
            )
    return tuple(found)


def _taken(term: Term, some: Int) -> Term:
    return replace(term, block=term.block[some], basis=None if term.basis is None else term.basis[some])


def _records(rows: Positions, coordinates: GivenCoordinates, terms: list[Term], *, exact: bool) -> Records:
    plain = position_records(rows, coordinates, exact=exact)
    arm = next((t for t in terms if t.basis is None), None)

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        v, (by_pose,) = plain.evaluate(state, some)
        R = state[POSE].ground_from_image[rows.image[some]]
        D = by_pose[:, :, :3]
        if arm is not None:
            turned = np.einsum("nij,nj->ni", R, state[LEVER_ARM][arm.block[some]])
            given = np.einsum("nij,nj->ni", R, rows.lever_arm_m[some])
            v = v + np.einsum("nij,nj->ni", D, turned - given)
            by_pose = np.concatenate([D, -D @ skew(turned)], axis=2)
        jacobians = [by_pose]
        for t in terms:
            jacobians.append(D @ R if t.basis is None else t.basis[some])
            if t.basis is not None:
                v = v + np.einsum("nij,nj->ni", t.basis[some], state[t.unknowns.name][t.block[some]])
        return v, tuple(jacobians)

    touches = (*plain.touches, *((t.unknowns.name, t.block.astype(np.int32)) for t in terms))
    return Records(plain.name, touches, evaluate, plain.whitener, plain.active)
