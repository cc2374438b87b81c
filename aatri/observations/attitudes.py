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
is that angle of R_pred less the observed one. Angles of standard deviation zero are exact:
constraints. s and d are shift and drift of a drift group, where asked for. With J the left Jacobian of the rotation
group

    dv/dd = dv/dw B',    dv/db = -dv/dw R_pred J(b),    dw a turn of R_pred from the left

All three angles and some of them differ in v and in dv/dw, the derivatives for a turn dw:

    all three angles    v = G^-1 log(R_pred R_obs'),    dv/dw = G^-1 J(w)^-1,    w = log(R_pred R_obs')
    some of them        v = a(R_pred) - a_observed,     dv/dw = G(a)^-1

Source: docs/formulas.md 5.6; Sola 2018 for J; Baeumker and Heimes 2001 (OEEPE), calibration of IMU and camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import whitener_of_sigmas
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.codes import OBSERVED_VALUE
from aatri.geometry.rotations import (
    angle_axes,
    angles_from_rotation,
    body_from_mount,
    exp_rotation,
    left_jacobian,
    log_rotation,
)
from aatri.observations.carried_vectors import BORESIGHT, BORESIGHTS
from aatri.observations.drift import drift_term, group_times, observed_with_terms, time_notes
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.parameters import uses_of_vector
from aatri.observations.poses import POSE, Poses
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

CARRIER = "roll-pitch-heading"

KIND = "attitude"
ATTITUDE_DRIFT = "attitude drift"

USES = ("exterior.angles_rad", "cameras.boresight_rad", "cameras.mount_deg", *uses_of_vector("boresight"))

LABELS = {
    "omega-phi-kappa": ("omega", "phi", "kappa"),
    "phi-omega-kappa": ("phi", "omega", "kappa"),
    "roll-pitch-heading": ("roll", "pitch", "heading"),
}


@dataclass(frozen=True)
class ObservedAngles:
    """Observed angles of n images."""

    angles_rad: Float
    """(n, 3), rad. NaN where not given."""
    system: str
    """omega-phi-kappa, phi-omega-kappa or roll-pitch-heading."""
    ground: Float
    """(n, 3, 3). Axes of the block from those the angles refer to: I, or (north, east, down)."""
    mount_deg: Any
    """(n,). Of the cameras; used for roll, pitch, heading."""

    @property
    def complete(self) -> Bool:
        """All three are given, (n,)."""
        return np.asarray(np.isfinite(self.angles_rad).all(axis=1))

    def take(self, rows: Int) -> ObservedAngles:
        """The chosen ones."""
        return ObservedAngles(self.angles_rad[rows], self.system, self.ground[rows], self.mount_deg[rows])

    def rotations(self) -> tuple[Float, Float]:
        """R_obs: axes of the block from those of the camera without boresight, and G, both (n, 3, 3)."""
        factors, axes = angle_axes(self.angles_rad, self.system)
        return (factors, axes) if self.system != CARRIER else (self.ground @ factors @ self._body, self.ground @ axes)

    def predicted(self, rotation: Float) -> tuple[Float, Float]:
        """The angles of rotations as R_obs, and G there."""
        if self.system != CARRIER:
            angles = angles_from_rotation(rotation, self.system)
            return angles, angle_axes(angles, self.system)[1]
        angles = angles_from_rotation(self.ground.swapaxes(1, 2) @ rotation @ self._body.swapaxes(1, 2), CARRIER)
        return angles, self.ground @ angle_axes(angles, self.system)[1]

    @property
    def _body(self) -> Float:
        return body_from_mount(self.mount_deg)


def whole_differences(predicted: Any, observed: Float, turning: Float) -> tuple[Any, Any]:
    """v (n, 3) and dv/dw (n, 3, 3), of three angles each.

    Parameters
    ----------
    predicted, observed : (n, 3, 3) float64
        R_pred, R_obs.
    turning : (n, 3, 3) float64
        G of the observed angles.
    """
    back, w = np.linalg.inv(turning), log_rotation(predicted @ observed.swapaxes(1, 2))
    return np.einsum("nij,nj->ni", back, w), back @ np.linalg.inv(left_jacobian(w))


def partial_differences(predicted: Float, observed: ObservedAngles) -> tuple[Float, Float]:
    """The same of angles of which some are given; zero where they are not."""
    angles, turning = observed.predicted(predicted)
    away = angles - observed.angles_rad
    observed_angle = np.isfinite(away)
    v = np.where(observed_angle, (np.where(observed_angle, away, 0.0) + np.pi) % (2 * np.pi) - np.pi, 0.0)
    return v, np.asarray(np.linalg.pinv(turning) * observed_angle[:, :, None])


class AttitudeOptions(Options):
    """Options of observed attitudes."""

    use: bool = Field(True, description="use observed attitudes")
    drift: Literal["none", "shift", "linear"] = Field(
        "none", description="what the attitudes of a drift group share: nothing, a shift, or a shift and a linear drift"
    )


@dataclass(frozen=True)
class Attitudes:
    """Observed attitudes."""

    row: Int
    image: Int
    camera: Int
    """(n,). Rows in exterior, images and cameras of the Block."""
    observed: Float
    """(n, 3, 3). R_obs: axes of the block from the axes of the camera without boresight; NaN where angles are given in
    part."""
    turning: Float
    """(n, 3, 3). G, columns."""
    sigma_rad: Float
    """(n, 3), rad. NaN where not given, 0 exact."""
    axes: Float
    """(n, 3, 3). B."""
    angles: ObservedAngles | None = None
    """As given; None: all three of every image."""

    @property
    def complete(self) -> Bool:
        """Images with all three angles, (n,)."""
        return np.ones(len(self.row), dtype=bool) if self.angles is None else self.angles.complete

    def by_exactness(self) -> Iterator[tuple[bool, Int]]:
        """False with the rows that have weighted angles, True with those that have exact ones."""
        for exact, angles in ((False, self.sigma_rad > 0), (True, self.sigma_rad == 0)):
            yield exact, np.flatnonzero(angles.any(axis=1))

    def take(self, rows: Int) -> Attitudes:
        """The chosen ones."""
        columns = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__ if name != "angles"}
        return replace(self, **columns, angles=None if self.angles is None else self.angles.take(rows))


def attitudes(source: ObservationSource, options: AttitudeOptions) -> tuple[Observed, ...]:
    """Observed attitudes of the images."""
    if not options.use:
        return ()
    block, rows = source.block, attitudes_of(source)
    if not len(rows.row):
        return ()
    group = block.exterior.drift_group[rows.row] if options.drift != "none" else np.full(len(rows.row), "")
    terms = []
    if (group != "").any():
        time = np.zeros(len(rows.row))
        if options.drift == "linear":
            time = group_times(block.images.time_s[rows.image], block.images.sequence[rows.image], group)
        given_angles = np.isfinite(rows.sigma_rad)
        terms.append(drift_term(group, time, given_angles, name=ATTITUDE_DRIFT, labels=LABELS[block.rotation]))
    boresights = BORESIGHTS.unknowns(block, np.unique(rows.camera))
    observed = observed_with_terms(
        lambda chosen, exact, _: attitude_records(rows.take(chosen), exact=exact),
        rows.by_exactness(),
        terms,
        rows.row,
        block.images.id[rows.image],
        "rad",
        {BORESIGHT: (boresights, block.cameras.boresight_rad.copy())},
    )
    if options.drift == "linear" and observed:
        observed = (replace(observed[0], notes=time_notes(block.images, rows.image, group)), *observed[1:])
    return (*observed, *BORESIGHTS.priors(block, block.cameras.boresight_rad, boresights))


def attitudes_of(source: ObservationSource) -> Attitudes:
    """Observed attitudes of a block, in the order of its exterior table."""
    block, e = source.block, source.block.exterior
    is_observed = np.isfinite(e.angles_rad).any(axis=1) & (e.angle_use == OBSERVED_VALUE) & block.images.active[e.image]
    row = np.flatnonzero(is_observed)
    image = e.image[row]
    camera = block.images.camera[image]
    place = np.where(
        finite_rows(e.position_m)[row, None],
        source.placed(e.position_m[row])[0],
        source.start[POSE].position_m[image] + source.origin_m,
    )
    angles = ObservedAngles(
        e.angles_rad[row], block.rotation, ground_of_angles(source, place), block.cameras.mount_deg[camera]
    )
    observed, turning = angles.rotations()
    return Attitudes(row, image, camera, observed, turning, e.angle_sigma_rad[row], source.axes_at(place), angles)


def boresight_sigma(block: Block) -> Float:
    """Standard deviations of the boresights, rad; of free ones, which nothing here determines, 0."""
    sigma = np.zeros((len(block.cameras), 3))
    p = block.camera_parameters
    for k, axis in enumerate("xyz"):
        of_axis = (p.name == f"boresight.{axis}") & ~p.free
        sigma[p.camera[of_axis], k] = np.nan_to_num(p.sigma[of_axis])
    return sigma


def ground_of_angles(source: ObservationSource, place: Float) -> Float:
    """What the angles refer to, in the axes of the block: its own axes, or north, east, down of each place."""
    n = len(place)
    if source.block.rotation != CARRIER:
        return np.broadcast_to(np.eye(3), (n, 3, 3))
    return source.north_east_down_at(place)


def attitude_records(rows: Attitudes, *, exact: bool = False) -> Records:
    """Records of observed attitudes, of their weighted angles or of their exact ones; they touch pose and boresight."""
    image, camera = rows.image.astype(np.int32), rows.camera.astype(np.int32)

    def differences(predicted: Any, chosen: Int) -> tuple[Any, Any]:
        complete = rows.complete[chosen]
        if complete.all():
            return whole_differences(predicted, rows.observed[chosen], rows.turning[chosen])
        assert rows.angles is not None
        v, by_turn = np.zeros((len(chosen), 3)), np.zeros((len(chosen), 3, 3))
        all_three, part = chosen[complete], chosen[~complete]
        v[complete], by_turn[complete] = whole_differences(
            predicted[complete], rows.observed[all_three], rows.turning[all_three]
        )
        v[~complete], by_turn[~complete] = partial_differences(predicted[~complete], rows.angles.take(part))
        return v, by_turn

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        b: Any = state[BORESIGHT][camera[chosen]]
        B = rows.axes[chosen].swapaxes(1, 2)
        predicted = B @ poses.ground_from_image[image[chosen]] @ exp_rotation(-b)
        v, by_turn = differences(predicted, chosen)
        by_position = np.zeros((len(chosen), 3, 3))
        by_pose = np.concatenate([by_position, by_turn @ B], axis=2)
        return v, (by_pose, -by_turn @ predicted @ left_jacobian(b))

    weighted = whitener_of_sigmas(np.where(rows.sigma_rad > 0, rows.sigma_rad, np.nan))
    whitener = np.where(rows.sigma_rad == 0, 1.0, 0.0) if exact else weighted
    touches = ((POSE, image), (BORESIGHT, camera))
    return Records(KIND, touches, evaluate, whitener, np.ones(len(image), dtype=bool))
