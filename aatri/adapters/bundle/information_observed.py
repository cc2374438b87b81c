"""Another block's Information as an observation of this one.

    v = W d + h,    W'W = N,    W'h = right,    d = x - value,    d = log(R R_value') of a rotation

v'v is what the other block's observations have of v'Pv, but for a constant. Unknowns that this block does not have are
eliminated first, and images and points that it and the block together do not determine; observations that stand in the
Information already do not count a second time.

Source: Helmert 1880; Wolf 1978; Mikhail & Ackermann 1976, 12 (sequential adjustment).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from aatri.adjustment.elimination.onto import pivoted_cholesky, rank_of, without
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.information import Information
from aatri.errors import ArtifactError
from aatri.geometry.rotations import left_jacobian, log_rotation
from aatri.ids import shown
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT, POSE, Poses, pose_unknowns
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.shared_equations import INFORMATION

POSE_LABELS = pose_unknowns((), np.zeros((0, 6), dtype=bool), np.zeros((0, 3))).labels


@dataclass(frozen=True)
class SharedBlock:
    """A block of unknowns that the Information and this block share."""

    group: str
    row: int
    scalar: Int
    """Which scalars of it."""
    column: Int
    """Their places among the unknowns of the Information."""
    value: Any
    """Where they are linearised: (k,) float64, or the position and the rotation matrix of an image."""


def shared_blocks(information: Information, inputs: BundleInput) -> list[SharedBlock]:
    """The unknowns of an Information that a block has, in its rows."""
    rows: dict[str, Mapping[str, int]] = {POSE: _rows(inputs.image_ids), POINT: _rows(inputs.point_ids)}
    labels: dict[str, tuple[str, ...]] = {POSE: POSE_LABELS, POINT: ("X", "Y", "Z")}
    for u in (u for o in inputs.observed for u in o.unknowns):
        rows[u.name], labels[u.name] = _rows(u.ids), u.labels
    unknowns = information.unknowns
    images = {name: k for k, name in enumerate(information.images.image.tolist())}
    shift = information.origin_m - inputs.origin_m
    first = np.flatnonzero(
        np.r_[True, (unknowns.group[1:] != unknowns.group[:-1]) | (unknowns.object[1:] != unknowns.object[:-1])]
    )
    blocks = []
    for columns in np.split(np.arange(len(unknowns)), first[1:]):
        group, name = str(unknowns.group[columns[0]]), str(unknowns.object[columns[0]])
        row = rows.get(group, {}).get(name, -1)
        if row < 0:
            continue
        names = unknowns.name[columns].tolist()
        if not set(names) <= set(labels[group]):
            raise other_set(group, name, names, labels[group])
        scalar = np.array([labels[group].index(label) for label in names])
        value: Any = unknowns.value[columns]
        if group == POSE:
            k = images[name]
            value = information.images.position_m[k] + shift, information.images.ground_from_image[k]
        elif group == POINT:
            value = value + shift[scalar]
        blocks.append(SharedBlock(group, row, scalar, columns, value))
    return blocks


def linearised_at(information: Information, block: Block) -> tuple[Poses, Float]:
    """Images and points of a block where an Information is linearised, in the frame of the adjustment; NaN others."""
    poses = Poses(np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan))
    _, own, there = np.intersect1d(block.images.id, information.images.image, return_indices=True)
    poses.position_m[own] = information.images.position_m[there] + information.origin_m
    poses.ground_from_image[own] = information.images.ground_from_image[there]
    xyz = np.full((len(block.points), 3), np.nan)
    unknowns, of_points = information.unknowns, information.unknowns.group == POINT
    for k, axis in enumerate("XYZ"):
        rows = np.flatnonzero(of_points & (unknowns.name == axis))
        _, own, there = np.intersect1d(block.points.id, unknowns.object[rows], return_indices=True)
        xyz[own, k] = unknowns.value[rows[there]] + information.origin_m[k]
    return poses, xyz


@dataclass(frozen=True)
class InformationShare:
    """What an Information adds to the adjustment of a block."""

    observed: Observed
    cost: float
    """What v'Pv has beside that of the observation."""
    observations: int
    """Observations that stand in it, less the rows of the observation."""
    unknowns: int
    """Unknowns that were eliminated, there and here."""


def information_share(information: Information, inputs: BundleInput) -> InformationShare:
    """The Information as one observation of the unknowns that the block shares with it.

    Raises
    ------
    ArtifactError
        If it shares none, or they are not the same.
    """
    blocks = shared_blocks(information, inputs)
    if not blocks:
        raise ArtifactError(
            f"the Information of block {information.block} shares no unknown with this block",
            remedy="keep the images or points that both have (`keep` of information/reduced)",
        )
    own = np.concatenate([b.column for b in blocks])
    other = np.setdiff1d(np.arange(len(information.unknowns)), own)
    N, right, fall, rank = without(information.matrix, information.unknowns.right, own, other)
    sizes = {POSE: 6, POINT: 3, **{u.name: u.size for o in inputs.observed for u in o.unknowns}}
    observed, best = _observed(information, blocks, sizes, N, right)
    images = {b"": observed}

    def determined(others: Sequence[Observed]) -> Observed:
        left = ~_open_blocks(blocks, N, others, sizes)
        if left.all():
            return observed
        if left.tobytes() not in images:
            left_of, stays = (
                [b for b, kept in zip(blocks, left) if kept],
                np.repeat(left, [len(b.column) for b in blocks]),
            )
            reduced, of_some, _, _ = without(N, right, np.flatnonzero(stays), np.flatnonzero(~stays))
            images[left.tobytes()] = _observed(information, left_of, sizes, reduced, of_some)[0]
        return images[left.tobytes()]

    return InformationShare(
        replace(observed, determined=determined),
        information.cost - fall - best,
        information.observations - observed.records.rows,
        information.eliminated + rank,
    )


def _open_blocks(blocks: list[SharedBlock], N: Float, others: Sequence[Observed], sizes: Mapping[str, int]) -> Bool:
    """Images and points of which the Information and all observations of the block together say too little, (n,)."""
    count = {group: np.zeros(1 + max((b.row for b in blocks if b.group == group), default=-1)) for group in sizes}
    for o in others:
        components = np.where(o.records.active, o.records.observed_components().sum(axis=1), 0)
        for group, block in o.records.touches if o.kind != INFORMATION else ():
            if group in (POSE, POINT):
                n = len(count[group])
                count[group] += np.bincount(block, components, n)[:n]
    start, is_open = np.cumsum([0, *(len(b.column) for b in blocks)]), np.zeros(len(blocks), dtype=bool)
    for k, b in enumerate(blocks):
        if b.group in (POSE, POINT) and count[b.group][b.row] < len(b.column):
            part = slice(start[k], start[k + 1])
            is_open[k] = rank_of(N[part, part]) + count[b.group][b.row] < len(b.column)
    return is_open


def _observed(
    information: Information, blocks: list[SharedBlock], sizes: Mapping[str, int], N: Float, right: Float
) -> tuple[Observed, float]:
    """Reduced normal equations of some blocks as one observation, and what v'Pv would fall to its minimum."""
    W, h = square_root(N, right)
    start = np.cumsum([0, *(len(b.column) for b in blocks)])
    place = np.cumsum([0, *(sizes[b.group] for b in blocks)])

    def differences(state: State) -> tuple[Float, list[Float]]:
        pairs = [_difference(state[b.group], b) for b in blocks]
        return np.concatenate([d for d, _ in pairs]), [D for _, D in pairs]

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        d, D = differences(state)
        jacobians = [W[:, start[k] : start[k + 1]] @ derivatives for k, derivatives in enumerate(D)]
        return np.repeat((W @ d + h)[None], len(rows), axis=0), tuple(
            np.repeat(J[None], len(rows), 0) for J in jacobians
        )

    def normal(state: State) -> tuple[Float, Float, float]:
        d, D = differences(state)
        total, gradient, total_gradient = np.zeros((place[-1], place[-1])), np.zeros(place[-1]), N @ d + right
        column = np.concatenate([place[k] + b.scalar for k, b in enumerate(blocks)])
        total[np.ix_(column, column)] = N
        gradient[column] = total_gradient
        for k, b in enumerate(blocks):
            if b.group == POSE:
                own, unit = slice(place[k], place[k + 1]), np.eye(6)
                unit[b.scalar] = D[k]
                total[:, own] = total[:, own] @ unit
                total[own] = unit.T @ total[own]
                gradient[own] = unit.T @ gradient[own]
        return total, gradient, float(d @ total_gradient + d @ right + h @ h)

    touches = tuple((b.group, np.array([b.row], dtype=np.int32)) for b in blocks)
    records = Records(INFORMATION, touches, evaluate, np.ones((1, len(W))), np.ones(1, dtype=bool), normal=normal)
    labels = tuple(str(k + 1) for k in range(len(W)))
    name = named(image=np.array([information.block]))
    return Observed(records, np.array([-1]), name, "", components=labels), float(h @ h)


def with_information(inputs: BundleInput, share: InformationShare, twice: tuple[Bool, ...]) -> BundleInput:
    """The block with the Information, and without its own observations that stand in it.

    Parameters
    ----------
    twice : tuple of (n,) bool
        For each of its observations which rows stand in the Information.
    """
    observed = [
        replace(o, records=replace(o.records, active=o.records.active & ~rows)) if rows.any() else o
        for o, rows in zip(inputs.observed, twice)
    ]
    return replace(inputs, observed=(*observed, share.observed))


def square_root(N: Float, right: Float) -> tuple[Float, Float]:
    """W and h with W'W = N and W'h = right; as many rows as N has rank."""
    L, order, scale = pivoted_cholesky(N)
    rank, W = L.shape[1], np.empty_like(L.T, order="C")
    W[:, order] = L.T * scale[order]
    return W, solve_triangular(L[:rank], (right / scale)[order[:rank]], lower=True)


def _difference(value: Any, b: SharedBlock) -> tuple[Float, Float]:
    """d of a block of unknowns, and its derivatives by a step of the whole block."""
    if not isinstance(value, Poses):
        return value[b.row][b.scalar] - b.value, np.eye(value.shape[1])[b.scalar]
    turn = log_rotation(value.ground_from_image[b.row] @ b.value[1].T)
    D = np.eye(6)
    D[3:, 3:] = np.linalg.inv(left_jacobian(turn[None])[0])
    return np.concatenate([value.position_m[b.row] - b.value[0], turn])[b.scalar], D[b.scalar]


def _rows(ids: Any) -> dict[str, int]:
    return {str(name): k for k, name in enumerate(ids)}


def other_set(group: str, name: str, of: list[str], own: tuple[str, ...]) -> ArtifactError:
    return ArtifactError(
        f"the Information has the {group} parameters {shown(of)} of {name}, this block {shown(own)}",
        remedy="adjust both with the same set and camera model",
    )
