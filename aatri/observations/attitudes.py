"""Observed attitudes (IMU): angles of the images, compared as rotation vectors, with the boresight of their camera.

    R_pred = B' R exp([b]x)',    v = G^-1 log(R_pred R_obs') + s + (t - t_mean) d

R is the rotation of the image, B the axes of the block at its projection centre (grid east, grid north, ellipsoid
normal; I where the adjustment is in the block's own frame), b the boresight of the camera: small turns about its axes,
fixed, weighted or free. R_obs is made of the three observed angles,

    omega, phi, kappa           R_obs = Rx Ry Rz against the axes of the block (or phi, omega, kappa)
    roll, pitch, heading        R_obs = (N, E, D) Rz(h) Ry(p) Rx(r) M

with north, east and down in the axes of the block - by the meridian convergence where headings count from true north -
and M the mount: image x clockwise from the nose, y to its left, z up. G are the axes about which the angles turn, so
that v is a rotation vector expressed in the three angles, with their standard deviations. s and d are shift and drift
of a drift group, where asked for. With J the left Jacobian of the rotation group

    dv/dd = G^-1 J(w)^-1 B',    dv/db = -G^-1 J(w)^-1 R_pred J(b),    w = log(R_pred R_obs')

Source: docs/formulas.md 5.6; Baeumker and Heimes 2001 (OEEPE), calibration of IMU and camera; Sola 2018 for J.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from aatri.adjustment.records import Records, whitener_of_sigmas
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int
from aatri.codes import OBSERVED_VALUE
from aatri.geometry.carrier import angle_axes, body_from_mount, exp_matrix, left_jacobian, log_vector
from aatri.geometry.vectors import finite_rows
from aatri.observations.attitude_notes import remarks_on
from aatri.observations.coordinates import value_records
from aatri.observations.drift import group_times
from aatri.observations.observed import Given, Observed, named
from aatri.observations.parameters import uses_of_vector
from aatri.observations.poses import POSE, Poses
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "attitude"
BORESIGHT, DRIFT = "boresight", "attitude drift"

AXES = "xyz"

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
        R_obs: axes of the block from the axes of the camera without boresight.
    turning : (n, 3, 3) float64
        G, columns.
    sigma_rad : (n, 3) float64, rad
    axes : (n, 3, 3) float64
        B.
    """

    row: Int
    image: Int
    camera: Int
    observed: Float
    turning: Float
    sigma_rad: Float
    axes: Float


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
    ids, number = np.unique(group, return_inverse=True)
    boresights = _boresights(block, np.unique(rows.camera))
    unknowns, start = [boresights.unknowns], {BORESIGHT: block.cameras.boresight_rad.copy()}
    found: list[Observed] = []
    labels = LABELS[block.rotation]
    for drifting in (False, True):
        some = np.flatnonzero((group != "") == drifting)
        if not len(some):
            continue
        part = Attitudes(*(getattr(rows, name)[some] for name in rows.__dataclass_fields__))
        own = list(unknowns)
        if drifting:
            free = np.ones((len(ids), 6), dtype=bool)
            free[:, 3:] = (np.bincount(number, np.abs(time), len(ids)) > 0)[:, None]
            names = tuple(f"{word} {label}" for word in ("shift", "drift") for label in labels)
            own.append(Unknowns(DRIFT, free & (ids != "")[:, None], names, ids, add_step))
            start[DRIFT] = np.zeros((len(ids), 6))
        records = attitude_records(part, (number[some].astype(np.int32), time[some]) if drifting else None)
        names_of = named(image=block.images.id[part.image])
        remarks = remarks_on(block, part, records, boresights.fixed)
        found.append(Observed(records, part.row, names_of, "rad", unknowns=tuple(own), start=dict(start),
                              remarks=remarks))  # fmt: skip
        unknowns = []
        start = {}
    return (*found, *boresights.priors)


def attitudes_of(given: Given) -> Attitudes:
    """Observed attitudes of a block, in the order of its exterior table."""
    block, e = given.block, given.block.exterior
    known = finite_rows(e.angles_rad) & (e.angle_use == OBSERVED_VALUE) & block.images.active[e.image]
    row = np.flatnonzero(known)
    image = e.image[row]
    camera = block.images.camera[image]
    place = np.where(finite_rows(e.position_m)[row, None], given.placed(e.position_m[row])[0],
                     given.start[POSE].position_m[image] + given.origin_m)  # fmt: skip
    axes = given.axes_at(place)
    ground = ground_of_angles(given, place)
    observed, turning = ground_from_camera(
        e.angles_rad[row], block.rotation, ground, body_from_mount(block.cameras.mount_deg[camera])
    )
    return Attitudes(row, image, camera, observed, turning, e.angle_sigma_rad[row], axes)


def ground_from_camera(angles_rad: Float, rotation: str, ground: Float, mount: Float) -> tuple[Float, Float]:
    """R_obs and G of observed angles.

    Parameters
    ----------
    angles_rad : (n, 3) float64, rad
    rotation : str
        System of the angles.
    ground : (n, 3, 3) float64
        Axes of the block from those the angles refer to: I, or (north, east, down).
    mount : (n, 3, 3) float64
        Body of the carrier from the camera; used for roll, pitch, heading.
    """
    factors, axes = angle_axes(angles_rad, rotation)
    if rotation != "roll-pitch-heading":
        return factors, axes
    return ground @ factors @ mount, ground @ axes


def ground_of_angles(given: Given, place: Float) -> Float:
    """What the angles refer to, in the axes of the block: its own axes, or north, east, down of each place."""
    n = len(place)
    if given.block.rotation != "roll-pitch-heading":
        return np.broadcast_to(np.eye(3), (n, 3, 3))
    return given.north_east_down_at(place)


@dataclass(frozen=True)
class _Boresights:
    unknowns: Unknowns
    priors: tuple[Observed, ...]
    fixed: npt.NDArray[np.bool_]


def _boresights(block: Block, cameras: Int) -> _Boresights:
    """The unknown boresights of the cameras that have attitudes, and the priors of the weighted ones."""
    n = len(block.cameras)
    free, sigma = np.zeros((n, 3), dtype=bool), np.zeros((n, 3))
    p = block.camera_parameters
    for k, axis in enumerate(AXES):
        mine = p.name == f"boresight.{axis}"
        open_ = p.free[mine] | (np.nan_to_num(p.sigma[mine]) > 0)
        free[p.camera[mine], k] = open_
        sigma[p.camera[mine], k] = np.where(p.free[mine], 0.0, np.nan_to_num(p.sigma[mine]))
    has = np.isin(np.arange(n), cameras)
    free &= has[:, None]
    labels = tuple(f"boresight {axis}" for axis in AXES)
    unknowns = Unknowns(BORESIGHT, free, labels, block.cameras.id, add_step)
    weighted = free & (sigma > 0)
    row = np.flatnonzero(weighted.any(axis=1)).astype(np.int32)
    priors: tuple[Observed, ...] = ()
    if len(row):
        covariance = np.where(sigma[row][:, :, None] > 0, sigma[row][:, :, None] ** 2, 1.0) * np.eye(3)
        records = value_records(f"{BORESIGHT}_prior", BORESIGHT, row, block.cameras.boresight_rad[row], covariance,
                                weighted[row])  # fmt: skip
        priors = (Observed(records, np.full(len(row), -1), named(image=block.cameras.id[row]), "rad",
                           components=labels),)  # fmt: skip
    return _Boresights(unknowns, priors, np.asarray(~free.any(axis=1)))


def attitude_records(rows: Attitudes, drift: tuple[Int, Float] | None = None) -> Records:
    """Records of observed attitudes; they touch pose, boresight, and drift where there is one."""
    back = np.linalg.inv(rows.turning)
    image, camera = rows.image.astype(np.int32), rows.camera.astype(np.int32)

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        b: Any = state[BORESIGHT][camera[some]]
        B = rows.axes[some].swapaxes(1, 2)
        predicted = B @ poses.ground_from_image[image[some]] @ exp_matrix(-b)
        w = log_vector(predicted @ rows.observed[some].swapaxes(1, 2))
        by_turn = back[some] @ np.linalg.inv(left_jacobian(w))
        v = np.einsum("nij,nj->ni", back[some], w)
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
    active = np.ones(len(image), dtype=bool)
    return Records(KIND, tuple(touches), evaluate, whitener_of_sigmas(np.where(rows.sigma_rad > 0, rows.sigma_rad,
                                                                              1e-9)), active)  # fmt: skip
