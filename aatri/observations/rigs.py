"""Rigs: cameras that are mounted together, exposure by exposure; the pose of an image is frame pose times mount pose.

    X = X_f + R_f t,    R = R_f M,    M = exp([w]x) M_0

t and M are place and rotation of a member in the camera axes of the frame, the first member of the rig: fixed, weighted
or free, scalar by scalar. The images of one exposure (same rig and time, else same strip and sequence) are tied to the
first of them, a, that is the frame where it is there; with F = R_a M_a' the rotation of the frame

    p = F'(X_b - X_a) - (t_b - t_a),    q = log(F' R_b M_b')

are observed as zero, with standard deviations so small (1/200 of those of an image point) that frame and mounts carry
all there is; larger ones (`rigs: {position_m, angle_deg}`) allow for synchronisation and flexing. With
y = F'(X_b - X_a), E = exp([q]x), J the left Jacobian of the rotation group

    dp = F' dX_b - F' dX_a + F'[X_b - X_a]x dd_a - [y]x J(w_a) dw_a + dt_a - dt_b
    dq = J(q)^-1 (F' dd_b - F' dd_a + J(w_a) dw_a - E J(w_b) dw_b)

Source: docs/formulas.md 5.7; Rupnik, Nex and Remondino 2015 (ISPRS J.), oblique multi-head systems.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int, finite_rows
from aatri.geometry.rotations import angle_axes, exp_rotation, left_jacobian, log_rotation, skew
from aatri.observations.given_coordinates import observed_priors
from aatri.observations.observed import ObservationSource, Observed, named
from aatri.observations.poses import POINT, POSE, Poses
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

POSITION, ROTATION, MOUNT = "rig position", "rig rotation", "mount"
"""Names of the kinds, and of the group of unknowns."""

USES = ("images.rig",)

TIGHT = 1 / 200
"""Of the standard deviation of an image point, as an angle and on the ground: ties of a rig."""

LABELS = ("mount X", "mount Y", "mount Z", "mount turn about x", "mount turn about y", "mount turn about z")


class RigOptions(Options):
    """Options of rigs."""

    use: bool = Field(True, description="images of one exposure are tied by the mounts of their rig")
    position_m: float | None = Field(
        None,
        gt=0,
        description="standard deviation of a place about its mount, m; null: 1/200 of what one image point "
        "measures on the ground",
    )
    angle_deg: float | None = Field(
        None,
        gt=0,
        description="standard deviation of a rotation about its mount, degrees; null: 1/200 of what one "
        "image point measures",
    )


@dataclass(frozen=True)
class RigPairs:
    """Images tied by a rig."""

    first: Int
    second: Int
    """(n,) int32. Rows in images."""
    first_mount: Int
    second_mount: Int
    """(n,) int32. Rows in rig_members."""
    mount: Float
    """(m, 3, 3). M_0 of every member."""


def rigs(source: ObservationSource, options: RigOptions) -> tuple[Observed, ...]:
    """Images of one exposure of a rig."""
    block = source.block
    pairs = rig_pairs(block)
    if not options.use or not len(pairs.first):
        return ()
    names = named(image=np.char.add(np.char.add(block.images.id[pairs.first], "-"), block.images.id[pairs.second]))
    members = block.rig_members
    position = np.where(members.position_free, 0.0, np.nan_to_num(members.position_sigma_m))
    angle = np.where(members.angle_free, 0.0, np.nan_to_num(members.angle_sigma_rad))
    sigma = np.concatenate([position, angle], axis=1)
    free = (sigma > 0) | np.concatenate([members.position_free, members.angle_free], axis=1)
    free &= np.isin(np.arange(len(members)), np.concatenate([pairs.first_mount, pairs.second_mount]))[:, None]
    ids = np.char.add(np.char.add(members.rig, "/"), members.member)
    unknowns = Unknowns(MOUNT, free, LABELS, ids, add_step, generator=_scaled)
    start = np.concatenate([members.position_m, np.zeros((len(members), 3))], axis=1)
    row = np.full(len(pairs.first), -1)
    by_position, by_rotation = rig_records(pairs, *_tight(source, options))
    C = sigma[:, :, None] ** 2 * np.eye(6)
    return (
        Observed(by_position, row, names, "m", unknowns=(unknowns,), start={MOUNT: start}),
        Observed(by_rotation, row, names, "rad"),
        *observed_priors(f"{MOUNT}_prior", MOUNT, ids, start, C, free & (sigma > 0), LABELS),
    )


def _tight(source: ObservationSource, options: RigOptions) -> tuple[float, float]:
    """Standard deviations of the ties, m and rad.

    Smaller ones would gain nothing, and leave nothing of the digits that tell whether a mount is determined.
    """
    angle, away = 2e-5, 1.0
    if source.image_points is not None:
        m, poses = source.image_points.measurements, source.start[POSE]
        c = source.block.cameras.principal_distance_mm[source.block.images.camera[m.image]]
        angle = float(np.nanmedian(m.sigma_mm[:, 0] / c))
        lengths = np.linalg.norm(source.start[POINT][m.point] - poses.position_m[m.image], axis=1)
        away = float(np.nanmedian(lengths)) if np.isfinite(lengths).any() else away
    position_m = TIGHT * angle * away if options.position_m is None else options.position_m
    return position_m, TIGHT * angle if options.angle_deg is None else float(np.radians(options.angle_deg))


def _scaled(state: State) -> Float:
    """A mount moves with the scale of the object space."""
    moves = np.zeros((len(state[MOUNT]), 6, 7))
    moves[:, :3, 6] = state[MOUNT][:, :3]
    return moves


def rig_pairs(block: Block) -> RigPairs:
    """The images of every exposure, each with the first of it: the frame, where it is there."""
    images, members = block.images, block.rig_members
    place = {(str(r), str(m)): k for k, (r, m) in enumerate(zip(members.rig, members.member))}
    exposures: dict[Any, list[tuple[int, int]]] = {}
    for image in np.flatnonzero((images.rig != "") & images.active):
        mount = place[str(images.rig[image]), str(images.member[image])]
        exposures.setdefault(_exposure(images, int(image)), []).append((mount, int(image)))
    pairs = []
    for seen in exposures.values():
        (first_mount, first), *others = sorted(seen, key=lambda s: (not members.is_frame[s[0]], s[0]))
        pairs += [(first, image, first_mount, mount) for mount, image in others]
    columns = np.array(pairs, dtype=np.int32).reshape(-1, 4)
    turned, _ = angle_axes(members.angles_rad, "omega-phi-kappa")
    return RigPairs(columns[:, 0], columns[:, 1], columns[:, 2], columns[:, 3], turned)


def _exposure(images: Any, k: int) -> Any:
    time = float(images.time_s[k])
    return (str(images.rig[k]), time if np.isfinite(time) else (int(images.strip[k]), float(images.sequence[k])))


def rig_records(pairs: RigPairs, position_m: float, angle_rad: float) -> tuple[Records, Records]:
    """Records of p and of q; both touch the two poses and the two mounts."""
    touches = ((POSE, pairs.first), (POSE, pairs.second), (MOUNT, pairs.first_mount), (MOUNT, pairs.second_mount))
    n = len(pairs.first)

    def place(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        a, b, ma, mb = pairs.first[rows], pairs.second[rows], pairs.first_mount[rows], pairs.second_mount[rows]
        mounts: Any = state[MOUNT]
        F = poses.ground_from_image[a] @ (exp_rotation(mounts[ma, 3:]) @ pairs.mount[ma]).swapaxes(1, 2)
        back, away = F.swapaxes(1, 2), poses.position_m[b] - poses.position_m[a]
        y = np.einsum("nij,nj->ni", back, away)
        zero, one = np.zeros((len(rows), 3, 3)), np.broadcast_to(np.eye(3), (len(rows), 3, 3))
        by_a = np.concatenate([-back, back @ skew(away)], axis=2)
        by_ma = np.concatenate([one, -skew(y) @ left_jacobian(mounts[ma, 3:])], axis=2)
        J = by_a, np.concatenate([back, zero], axis=2), by_ma, np.concatenate([-one, zero], axis=2)
        return y - mounts[mb, :3] + mounts[ma, :3], J

    def turn(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        a, b, ma, mb = pairs.first[rows], pairs.second[rows], pairs.first_mount[rows], pairs.second_mount[rows]
        mounts: Any = state[MOUNT]
        back = exp_rotation(mounts[ma, 3:]) @ pairs.mount[ma] @ poses.ground_from_image[a].swapaxes(1, 2)
        E = back @ poses.ground_from_image[b] @ (exp_rotation(mounts[mb, 3:]) @ pairs.mount[mb]).swapaxes(1, 2)
        q = log_rotation(E)
        inverse, zero = np.linalg.inv(left_jacobian(q)), np.zeros((len(rows), 3, 3))
        turned = inverse @ back
        by = (-turned, turned, inverse @ left_jacobian(mounts[ma, 3:]), -inverse @ E @ left_jacobian(mounts[mb, 3:]))
        return q, tuple(np.concatenate([zero, J], axis=2) for J in by)

    active = np.ones(n, dtype=bool)
    return (
        Records(POSITION, touches, place, np.full((n, 3), 1.0 / position_m), active),
        Records(ROTATION, touches, turn, np.full((n, 3), 1.0 / angle_rad), active),
    )


def poses_by_rigs(block: Block, poses: Poses) -> Poses:
    """Poses that are not known, from those of the same exposure and the mounts as given."""
    if not len(block.rig_members):
        return poses
    pairs, t = rig_pairs(block), block.rig_members.position_m
    position, rotation = poses.position_m.copy(), poses.ground_from_image.copy()
    for source, target, ms, mt in (
        (pairs.first, pairs.second, pairs.first_mount, pairs.second_mount),
        (pairs.second, pairs.first, pairs.second_mount, pairs.first_mount),
    ):
        complete = finite_rows(position) & finite_rows(rotation)
        rows = np.flatnonzero(complete[source] & ~complete[target])
        F = rotation[source[rows]] @ pairs.mount[ms[rows]].swapaxes(1, 2)
        rotation[target[rows]] = F @ pairs.mount[mt[rows]]
        position[target[rows]] = position[source[rows]] + np.einsum("nij,nj->ni", F, t[mt[rows]] - t[ms[rows]])
    return Poses(position, rotation)
