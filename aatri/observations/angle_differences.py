"""Differences between the attitude of an image and its observed angles, and their derivatives.

    all three angles    v = G^-1 log(R_pred R_obs'),    dv = G^-1 J(w)^-1 dw,    w = log(R_pred R_obs')
    some of them        v = a(R_pred) - a_observed,     dv = G(a)^-1 dw

for a turn dw of R_pred from the left: all three as a rotation vector expressed in the angles, good in any attitude; a
heading or kappa alone as that angle of the image. G are the axes about which the angles turn, J is the left Jacobian
of the rotation group. Source: docs/formulas.md 5.6; Sola 2018 for J.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.rotations import angle_axes, angles_from_rotation, body_from_mount, left_jacobian, log_rotation

CARRIER = "roll-pitch-heading"


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
