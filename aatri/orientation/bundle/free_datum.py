"""The datum of a free block: what observations leave open of the seven, what to hold, and inner constraints.

A similarity about the centre O of the block moves centres and points by

    dX = e t + r x (X - O) + m (X - O),     d = r for the rotation of an image (R <- exp([d]x) R)

with shift e t (e the extent of the block, so that all seven are of one size), rotation r, and scale m: the seven
columns of H. Image points do not see it. Control and observed positions see some of it; what they leave open, H V, is
free.

Values: the adjusted block is moved, within what is open, until sum D (X - X_start) has no component along H V over the
datum. For a block without any control these are the seven sums

    sum dX = 0,    sum (X - O) x dX = 0,    sum (X - O)'dX = 0,    dX = X - X_start

the least-squares fit of the datum onto its start values. Covariances: `aatri.adjustment.covariance.s_transformation`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import expm, qr

from aatri.adjustment.covariance.s_transformation import STransformation, s_transformation
from aatri.adjustment.elimination.backsolve import cost_of
from aatri.adjustment.openness.nearly_open import least_certain
from aatri.adjustment.openness.unseen_motions import unseen_combinations
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjusted import Adjusted, factor_of
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import nearest_rotation, skew
from aatri.geometry.similarity import motions_about
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle.limits import NEARLY_SAME_COST, OPEN_DIRECTION, SAME_COST

MOST_MOVES = 100


@dataclass(frozen=True)
class FreeDatum:
    """A block whose datum is free."""

    unknowns: Sequence[Unknowns]
    records: Sequence[Records]
    """The problem, nothing held for the datum; the records without those that see no similarity, the image points."""
    start: State
    part: Mapping[str, Bool]
    """Mapping of (n,). What is adjusted, by group."""
    over: Mapping[str, Bool]
    """Mapping of (n,). Images whose projection centres, and points whose coordinates, carry the datum."""
    absent: Bool
    """(n_points, 3). Coordinates of points that are no unknowns and take no part in a movement."""

    @staticmethod
    def of(
        unknowns: Sequence[Unknowns],
        records: Sequence[Records],
        start: State,
        part: Mapping[str, Bool],
        over: str,
        marked: Bool,
        absent: Bool,
    ) -> FreeDatum:
        """The datum rests on all points, all images, or the marked points."""
        image, point = part[POSE], part[POINT]
        none = np.zeros_like(point)
        points = {"points": point, "images": none, "marked": point & marked}[over]
        return FreeDatum(unknowns, records, start, part, {POSE: image & (over == "images"), POINT: points}, absent)


def with_minimum_datum(free: FreeDatum) -> list[Unknowns]:
    """The unknowns with as many scalars of the poses (without images: points) held as are open, far apart.

    Raises
    ------
    GeometryError
        If nothing is open.
    """
    bodies = next((u for u in free.unknowns if u.name == POSE), None) or free.unknowns[-1]
    H = similarity_directions(free, free.start)
    V = open_directions(free, free.start, H)
    extent = _size(free, free.start)[1]
    candidates = np.flatnonzero(bodies.free)
    rows = (H[bodies.name] @ V).reshape(-1, V.shape[1])[candidates]
    rows = rows * np.where(candidates % bodies.size < 3, 1.0, extent)[:, None]
    _, _, order = qr(rows.T, mode="economic", pivoting=True)
    fixed = np.zeros(bodies.free.size, dtype=bool)
    fixed[candidates[order[: V.shape[1]]]] = True
    bodies_with_datum = replace(bodies, free=bodies.free & ~fixed.reshape(bodies.free.shape))
    return [bodies_with_datum if u is bodies else u for u in free.unknowns]


def onto_inner_constraints(
    free: FreeDatum, adjusted: Adjusted, readjust: Callable[[State], Adjusted] | None = None
) -> Adjusted:
    """The adjusted block moved within what is open until its datum has no shift along it against the start.

    Unknowns that do not move linearly (planes, lines) follow a large movement to first order only: then the block is
    adjusted `readjust` from where it is, and moved by what little is left.

    Raises
    ------
    GeometryError
        If the datum does not carry what is open: too few points or images, or all on a line.
    ConvergenceError
        If no similarity fits the block onto its start; where control ties it, what that hardly tells is named.
    """
    moved: dict[str, Any] = dict(adjusted.state)
    for _ in range(MOST_MOVES):
        H = similarity_directions(free, moved)
        V = open_directions(free, moved, H)
        q = -V @ _shift_along(free, moved, H, V)
        try:
            moved = _moved(free, moved, H, q)
        except ConvergenceError as error:
            raise (_run_away(adjusted, error) if V.shape[1] < 7 else error) from None
        if np.abs(q).max() < 1e-13:
            break
    else:
        raise ConvergenceError(
            "the block could not be fitted onto the start values of its datum",
            remedy="start from better initial values, or use `datum: minimal`",
        )
    cost = cost_of(adjusted.problem, moved)
    if readjust is not None and abs(cost - adjusted.cost) > NEARLY_SAME_COST * (1.0 + adjusted.cost):
        return onto_inner_constraints(free, readjust(moved))
    if abs(cost - adjusted.cost) > SAME_COST * (1.0 + adjusted.cost):
        raise GeometryError(
            f"what control and positions leave open is not free beyond small movements: cost {adjusted.cost:.6g} "
            f"becomes {cost:.6g}",
            remedy="use `datum: minimal`, or leave out control or positions",
        )
    return replace(adjusted, state=moved)


def _run_away(adjusted: Adjusted, error: ConvergenceError) -> ConvergenceError:
    """Why a block that something ties to the ground has run away: what control hardly tells, if that is known."""
    try:
        weakest = least_certain(adjusted.problem, factor_of(adjusted), adjusted.state)
    except GeometryError:  # what has failed may have no factor either
        return error
    return ConvergenceError(
        f"{error.what}; hardly determined is the {weakest}",
        remedy=f"give control or positions that tell it, or make `approximate` what hardly does; or {error.remedy}",
    )


def free_covariances(free: FreeDatum, adjusted: Adjusted, groups: Mapping[str, Float]) -> dict[str, Float]:
    """Covariances under inner constraints from those with the minimum held.

    Parameters
    ----------
    adjusted : Adjusted
        After `onto_inner_constraints`.
    groups : mapping of (n, k, k) float64
    """
    determined = np.asarray(np.isfinite(groups[POINT]).all(axis=(1, 2)))
    return transformation_of(free, adjusted, determined).covariances(groups)


def transformation_of(free: FreeDatum, adjusted: Adjusted, determined: Bool) -> STransformation:
    """What takes covariances to inner constraints; `determined` are the points that have one, (n,)."""
    H = similarity_directions(free, adjusted.state)
    V = open_directions(free, adjusted.state, H)
    pose = np.zeros((len(free.part[POSE]), 6), dtype=bool)
    pose[:, :3] = free.over[POSE][:, None]
    datum = {POINT: np.repeat((free.over[POINT] & determined)[:, None], 3, axis=1)}
    if POSE in H:
        datum[POSE] = pose
    along = {group: h @ V for group, h in H.items()}
    return s_transformation(adjusted.problem, adjusted.state, along, datum)


def similarity_directions(free: FreeDatum, state: State) -> dict[str, Float]:
    """The seven directions H about the centre, (n, k, 7) for each group they move; zero for what is not adjusted."""
    centre, extent = _size(free, state)
    about_centre = motions_about(centre)
    about_centre[:, :3] *= extent
    directions = {}
    for u in free.unknowns:
        if u.generator is not None:
            moving = np.repeat(free.part[u.name][:, None], u.size, axis=1)
            moving &= ~free.absent if u.name == POINT else True
            directions[u.name] = np.where(moving[:, :, None], u.generator(state) @ about_centre, 0.0)
    return directions


def open_directions(free: FreeDatum, state: State, H: Mapping[str, Float]) -> Float:
    """What the records and the held scalars leave open of H: V, (7, d), orthonormal.

    Raises
    ------
    GeometryError
        If nothing is left open.
    """
    fixed = [H[u.name][~u.free] for u in free.unknowns if u.name in H]
    V = unseen_combinations(free.records, state, H, [_without_effect(H) * _size(free, state)[1], *fixed])[0]
    if not V.shape[1]:
        raise GeometryError(
            "control and observed positions determine the datum: nothing is free",
            remedy="use `datum: given`, or leave out control or positions",
        )
    return np.asarray(V)


def _without_effect(H: Mapping[str, Float]) -> Float:
    """Directions in which nothing moves, (7, 7): the tilts of a plane network."""
    everything = np.concatenate([h.reshape(-1, 7) for h in H.values()])
    _, values, vectors = np.linalg.svd(np.linalg.qr(everything, mode="r"))
    return np.asarray(vectors * (np.pad(values, (0, 7 - len(values))) <= OPEN_DIRECTION * values[0])[:, None])


def _shift_along(free: FreeDatum, state: State, H: Mapping[str, Float], V: Float) -> Float:
    """The shift of the datum against the start in the open directions, (d,)."""
    shift = {POSE: state[POSE].position_m - free.start[POSE].position_m, POINT: state[POINT] - free.start[POINT]}
    carrying = [(group, carriers) for group, carriers in free.over.items() if group in H]
    normal, right_hand_side = np.zeros((V.shape[1], V.shape[1])), np.zeros(V.shape[1])
    for group, carriers in carrying:
        G = H[group][carriers, :3] @ V
        normal += np.einsum("nki,nkj->ij", G, G)
        right_hand_side += np.einsum("nki,nk->i", G, shift[group][carriers])
    if not np.linalg.eigvalsh(normal)[0] > OPEN_DIRECTION * _size(free, state)[1] ** 2:
        count = int(sum(carriers.sum() for _, carriers in carrying))
        raise GeometryError(
            f"the {count} images and points of the datum do not carry the {V.shape[1]} components that are free",
            remedy="let it rest on more of them, not all on one line",
        )
    return np.asarray(np.linalg.solve(normal, right_hand_side))


def _size(free: FreeDatum, state: State) -> tuple[Float, float]:
    """Centre and extent of the block."""
    x = np.concatenate([state[POSE].position_m[free.part[POSE]], state[POINT][free.part[POINT]]])
    centre = x.mean(axis=0)
    return centre, float(np.abs(x - centre).max())


def _moved(free: FreeDatum, state: State, H: Mapping[str, Float], q: Float) -> dict[str, Any]:
    """The block after the similarity exp of the seven parameters q, about the centre.

    Raises
    ------
    ConvergenceError
        If its scale overflows or vanishes.
    """
    centre, extent = _size(free, state)
    generator = np.zeros((4, 4))
    generator[:3, :3] = skew(q[3:6]) + q[6] * np.eye(3)
    generator[:3, 3] = extent * q[:3]
    with np.errstate(over="ignore", invalid="ignore"):
        T, scale = expm(generator), float(np.exp(q[6]))
    if not (np.isfinite(T).all() and 0.0 < scale < np.inf):
        raise ConvergenceError(
            "the block has run away from the start values of its datum: no similarity fits it onto them",
            remedy="look for gross errors (`blunders: robust_snooping`) or exchanged numbers; start from better values",
        )
    rotation = nearest_rotation(T[:3, :3] / scale)
    poses: Poses = state[POSE]
    position = centre + (poses.position_m - centre) @ T[:3, :3].T + T[:3, 3]
    ground = centre + (state[POINT] - centre) @ T[:3, :3].T + T[:3, 3]
    other_values = {
        u.name: u.retract(state[u.name], H[u.name] @ q)
        for u in free.unknowns
        if u.name in H and u.name not in (POSE, POINT)
    }
    return {**state, **other_values, POSE: Poses(position, rotation @ poses.ground_from_image), POINT: ground}
