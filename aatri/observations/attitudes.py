"""Observed attitudes (IMU): angles of the images, compared as rotation vectors, with the boresight of their camera.

    R_pred = B' R exp([b]x)',    v = G^-1 log(R_pred R_obs') + s + (t - t_mean) d

R is the rotation of the image, B the axes of the block at its projection centre (grid east, grid north, ellipsoid
normal; I where the adjustment is in the block's own frame), b the boresight of the camera: small turns about its axes,
fixed, weighted or free. R_obs is made of the three observed angles,

    omega, phi, kappa           R_obs = Rx Ry Rz against the axes of the block (or phi, omega, kappa)
    roll, pitch, heading        R_obs = (N, E, D) Rz(h) Ry(p) Rx(r) M

with north, east and down in the axes of the block - by the meridian convergence where headings count from true north -
and M the mount: image x clockwise from the nose, y to its left, z up. G are the axes about which the angles turn, so
that v is a rotation vector expressed in the three angles, with their standard deviations; of a heading or kappa alone v
is that angle of R_pred less the observed one (`angle_differences`). Angles of standard deviation zero are exact:
constraints. s and d are shift and drift of a drift group, where asked for. With J the left Jacobian of the rotation
group

    dv/dd = dv/dw B',    dv/db = -dv/dw R_pred J(b),    dw a turn of R_pred from the left

Source: docs/formulas.md 5.6; Baeumker and Heimes 2001 (OEEPE), calibration of IMU and camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from aatri.adjustment.records import Records, whitener_of_sigmas
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import OBSERVED_VALUE
from aatri.geometry.rotations import exp_rotation, left_jacobian
from aatri.geometry.vectors import finite_rows
from aatri.observations.angle_differences import (
    CARRIER,
    ObservedAngles,
    partial_differences,
    whole_differences,
)
from aatri.observations.carried_vectors import BORESIGHT, BORESIGHTS
from aatri.observations.drift import free_drift, group_times, time_notes
from aatri.observations.observed import Given, Observed, named
from aatri.observations.parameters import uses_of_vector
from aatri.observations.poses import POSE, Poses
from aatri.options import Options

if TYPE_CHECKING:
    pass

KIND = "attitude"
DRIFT = "attitude drift"

USES = ("exterior.angles_rad", "cameras.boresight_rad", "cameras.mount_deg", *uses_of_vector("boresight"))

LABELS = {
    "omega-phi-kappa": ("omega", "phi", "kappa"),
    "phi-omega-kappa": ("phi", "omega", "kappa"),
    "roll-pitch-heading": ("roll", "pitch", "heading"),
}


class AttitudeOptions(Options):
    """Options of observed attitudes."""

    use: bool = Field(True, description="use observed attitudes")
    drift: Literal["none", "shift", "linear"] = Field(
        "none", description="what the attitudes of a drift group share: nothing, a shift, or a shift and a linear drift"
    )


@dataclass(frozen=True)
class Attitudes:
    """Observed attitudes.

    Attributes
    ----------
    row, image, camera : (n,) int
        Rows in exterior, images and cameras of the Block.
    observed : (n, 3, 3) float64
        R_obs: axes of the block from the axes of the camera without boresight; NaN where angles are given in part.
    turning : (n, 3, 3) float64
        G, columns.
    sigma_rad : (n, 3) float64, rad
        NaN where not given, 0 exact.
    axes : (n, 3, 3) float64
        B.
    angles : ObservedAngles, optional
        As given; None: all three of every image.
    """

    row: Int
    image: Int
    camera: Int
    observed: Float
    turning: Float
    sigma_rad: Float
    axes: Float
    angles: ObservedAngles | None = None

    @property
    def whole(self) -> Bool:
        """Images with all three angles, (n,)."""
        return np.ones(len(self.row), dtype=bool) if self.angles is None else self.angles.whole

    def take(self, some: Int) -> Attitudes:
        """The chosen ones."""
        columns = {name: getattr(self, name)[some] for name in self.__dataclass_fields__ if name != "angles"}
        return replace(self, **columns, angles=None if self.angles is None else self.angles.take(some))


def attitudes(given: Given, options: AttitudeOptions) -> tuple[Observed, ...]:
    """Observed attitudes of the images."""
    block = given.block
    rows = attitudes_of(given)
    if not options.use or not len(rows.row):
        return ()
    group = block.exterior.drift_group[rows.row] if options.drift != "none" else np.full(len(rows.row), "")
    time = np.zeros(len(rows.row))
    if options.drift == "linear":
        time = group_times(block.images.time_s[rows.image], block.images.sequence[rows.image], group)
    drift = _drift(group, time, rows.sigma_rad, LABELS[block.rotation])
    boresights = BORESIGHTS.unknowns(block, np.unique(rows.camera))
    new = {BORESIGHT: (boresights, block.cameras.boresight_rad.copy())}
    found: list[Observed] = []
    for drifting in (False, True):
        for exact in (False, True):
            observed = (rows.sigma_rad == 0) if exact else rows.sigma_rad > 0
            some = np.flatnonzero(((group != "") == drifting) & observed.any(axis=1))
            if not len(some):
                continue
            if drifting and not any(u.name == DRIFT for o in found for u in o.unknowns):
                new[DRIFT] = (drift.unknowns, np.zeros((len(drift.unknowns.free), 6)))
            part = rows.take(some)
            records = attitude_records(part, (drift.group[some], time[some]) if drifting else None, exact=exact)
            found.append(
                Observed(
                    records,
                    part.row,
                    named(image=block.images.id[part.image]),
                    "rad",
                    exact=exact,
                    unknowns=tuple(u for u, _ in new.values()),
                    start={name: start for name, (_, start) in new.items()},
                )
            )
            new = {}
    if options.drift == "linear" and found:
        found[0] = replace(found[0], notes=time_notes(block.images, rows.image, group))
    return (*found, *BORESIGHTS.priors(block, block.cameras.boresight_rad, boresights))


@dataclass(frozen=True)
class _Drift:
    """Shift and drift of groups, and the group of each attitude."""

    unknowns: Unknowns
    group: Int


def _drift(group: Text, time: Float, sigma_rad: Float, labels: tuple[str, ...]) -> _Drift:
    ids, number = np.unique(group, return_inverse=True)
    block = np.where(group != "", number, -1)
    names = tuple(f"{word} {label}" for word in ("shift", "drift") for label in labels)
    free = free_drift(block, len(ids), time, np.isfinite(sigma_rad))
    return _Drift(Unknowns(DRIFT, free, names, ids, add_step), number.astype(np.int32))


def attitudes_of(given: Given) -> Attitudes:
    """Observed attitudes of a block, in the order of its exterior table."""
    block, e = given.block, given.block.exterior
    known = np.isfinite(e.angles_rad).any(axis=1) & (e.angle_use == OBSERVED_VALUE) & block.images.active[e.image]
    row = np.flatnonzero(known)
    image = e.image[row]
    camera = block.images.camera[image]
    place = np.where(
        finite_rows(e.position_m)[row, None],
        given.placed(e.position_m[row])[0],
        given.start[POSE].position_m[image] + given.origin_m,
    )
    angles = ObservedAngles(
        e.angles_rad[row], block.rotation, ground_of_angles(given, place), block.cameras.mount_deg[camera]
    )
    observed, turning = angles.rotations()
    return Attitudes(row, image, camera, observed, turning, e.angle_sigma_rad[row], given.axes_at(place), angles)


def ground_of_angles(given: Given, place: Float) -> Float:
    """What the angles refer to, in the axes of the block: its own axes, or north, east, down of each place."""
    n = len(place)
    if given.block.rotation != CARRIER:
        return np.broadcast_to(np.eye(3), (n, 3, 3))
    return given.north_east_down_at(place)


def attitude_records(rows: Attitudes, drift: tuple[Int, Float] | None = None, *, exact: bool = False) -> Records:
    """Records of observed attitudes, of their weighted angles or of their exact ones.

    They touch pose, boresight, and drift where there is one.
    """
    image, camera = rows.image.astype(np.int32), rows.camera.astype(np.int32)

    def differences(predicted: Any, some: Int) -> tuple[Any, Any]:
        whole = rows.whole[some]
        if whole.all():
            return whole_differences(predicted, rows.observed[some], rows.turning[some])
        assert rows.angles is not None
        v, by_turn = np.zeros((len(some), 3)), np.zeros((len(some), 3, 3))
        mine, part = some[whole], some[~whole]
        v[whole], by_turn[whole] = whole_differences(predicted[whole], rows.observed[mine], rows.turning[mine])
        v[~whole], by_turn[~whole] = partial_differences(predicted[~whole], rows.angles.take(part))
        return v, by_turn

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        b: Any = state[BORESIGHT][camera[some]]
        B = rows.axes[some].swapaxes(1, 2)
        predicted = B @ poses.ground_from_image[image[some]] @ exp_rotation(-b)
        v, by_turn = differences(predicted, some)
        nothing = np.zeros((len(some), 3, 3))
        by_pose = np.concatenate([nothing, by_turn @ B], axis=2)
        jacobians = [by_pose, -by_turn @ predicted @ left_jacobian(b)]
        if drift is not None:
            number, time = drift
            by_drift = np.concatenate([nothing + np.eye(3), time[some, None, None] * np.eye(3)], axis=2)
            v = v + np.einsum("nij,nj->ni", by_drift, state[DRIFT][number[some]])
            jacobians.append(by_drift)
        return v, tuple(jacobians)

    touches: list[tuple[str, Int]] = [(POSE, image), (BORESIGHT, camera)]
    if drift is not None:
        touches.append((DRIFT, drift[0]))
    whitener = np.where(rows.sigma_rad == 0, 1.0, 0.0) if exact else whitener_of_sigmas(_weighted(rows.sigma_rad))
    return Records(KIND, tuple(touches), evaluate, whitener, np.ones(len(image), dtype=bool))


def _weighted(sigma_rad: Float) -> Float:
    return np.where(sigma_rad > 0, sigma_rad, np.nan)
