"""What is given besides coordinates: distances between points of strips, and attitudes of images in a strip.

    v = |l| - d,      l = X_b - X_a + h e_Z, or its plan part,    dv/dX_b = l'/|l| = -dv/dX_a         distance
    v = G^-1 w,       w = log(R R_k R_obs'),                      dv/dr = G^-1 J(w)^-1                 attitude

X are the ground points of the adjustment, unknowns of their own beside the points of the strips (`tie_records`), so
that a distance, a control point and a position at one point share the errors of that point, once. h is the height of
the target less that of the instrument. R is the rotation of the strip (its increment r turns the ground side), R_k that
of an image in the strip, R_obs the observed one, G the axes about which its angles turn (`observations.attitudes`), J
the left Jacobian of the rotation group.

Source: Kraus, Photogrammetry; docs/formulas.md 5.4 and 5.6; Sola 2018 for J.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.geometry.carrier import left_jacobian, log_vector
from aatri.orientation.free_block.tie_records import EXACT, POINT, STRIP


@dataclass(frozen=True)
class GivenDistances:
    """Distances between ground points.

    Attributes
    ----------
    kind : str
    start, end : (n,) int
        Numbers of the points among those of the ties.
    value_m, sigma_m : (n,) float64, m
        Sigma 0: exact.
    plan : (n,) bool
        Horizontal distances.
    rise_m : (n,) float64, m
        Height of the target above its point less that of the instrument above its own.
    """

    kind: str
    start: Int
    end: Int
    value_m: Float
    sigma_m: Float
    plan: Bool
    rise_m: Float

    @property
    def given(self) -> Bool:
        """Components that are given, (n, 3): one."""
        return np.tile([True, False, False], (len(self.start), 1))

    @property
    def variance(self) -> Float:
        """Of each, m^2."""
        return np.asarray(self.sigma_m**2)

    def whitener(self, typical_m2: float) -> Float:
        """Inverse standard deviations, (n, 1, 1); exact ones get `EXACT` times that of the strips' points."""
        least = EXACT * np.sqrt(typical_m2)
        return np.asarray(1.0 / np.maximum(self.sigma_m, least))[:, None, None]

    def records(self, base_m: Float) -> Records:
        """Records of ground points reduced to `base_m`."""
        a, b = self.start.astype(np.int32), self.end.astype(np.int32)

        def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
            X, p, q = state[POINT], a[rows], b[rows]
            line = (X[q] - X[p]) + (base_m[q] - base_m[p])
            line[:, 2] += self.rise_m[rows]
            line[self.plan[rows], 2] = 0.0
            length = np.linalg.norm(line, axis=1)
            J = (line / length[:, None])[:, None, :]
            return (length - self.value_m[rows])[:, None], (-J, J)

        n = len(a)
        return Records(self.kind, ((POINT, a), (POINT, b)), evaluate, np.ones((n, 1, 1)), np.ones(n, dtype=bool))


@dataclass(frozen=True)
class GivenAttitudes:
    """Observed rotations of images of strips.

    Attributes
    ----------
    kind : str
    strip : (n,) int
    strip_from_image : (n, 3, 3) float64
    observed : (n, 3, 3) float64
        Ground from image.
    turning : (n, 3, 3) float64
        G, columns.
    covariance_rad2 : (n, 3, 3) float64, rad^2
        Of the angles, with the errors of the images in their strip.
    """

    kind: str
    strip: Int
    strip_from_image: Float
    observed: Float
    turning: Float
    covariance_rad2: Float

    @property
    def given(self) -> Bool:
        """Components that are given, (n, 3): all."""
        return np.ones((len(self.strip), 3), dtype=bool)

    @property
    def variance(self) -> Float:
        """Trace of each covariance, rad^2."""
        return np.asarray(np.einsum("nii->n", self.covariance_rad2))

    def whitener(self, typical_m2: float) -> Float:  # noqa: ARG002
        """T with T'T = C^-1, (n, 3, 3); angles know nothing of lengths."""
        return np.linalg.inv(np.linalg.cholesky(self.covariance_rad2))

    def records(self, base_m: Float) -> Records:  # noqa: ARG002
        """Records of the strips' rotations; no ground point is concerned."""
        back, strip = np.linalg.inv(self.turning), self.strip.astype(np.int32)

        def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
            poses: Any = state[STRIP]
            turned = poses.rotation[strip[rows]] @ self.strip_from_image[rows]
            w = log_vector(turned @ self.observed[rows].swapaxes(1, 2))
            J = np.zeros((len(rows), 3, 7))
            J[:, :, 3:6] = back[rows] @ np.linalg.inv(left_jacobian(w))
            return np.einsum("nij,nj->ni", back[rows], w), (J,)

        n = len(strip)
        unit = np.broadcast_to(np.eye(3), (n, 3, 3))  # weighted later
        return Records(self.kind, ((STRIP, strip),), evaluate, unit, np.ones(n, dtype=bool))
