"""What is given besides coordinates: distances between points of strips, and attitudes of images in a strip.

    v = |l| - d,      l = X_b - X_a + h e_Z, or its plan part,    dv/dX_b = l'/|l| = -dv/dX_a         distance
    v = G^-1 w,       w = log(R R_k R_obs'),                      dv/dr = G^-1 J(w)^-1                 attitude

X are the ground points of the adjustment, unknowns of their own beside the points of the strips
(`observations.ties`), so that a distance, a control point and a position at one point share the errors of that point,
once. h is the height of the target less that of the instrument. R is the rotation of the strip (its increment r turns
the ground side), R_k that of an image in the strip, R_obs the observed one, G the axes about which its angles turn
(`observations.attitudes`), J the left Jacobian of the rotation group.

Source: Kraus, Photogrammetry; docs/formulas.md 5.4 and 5.6; Sola 2018 for J.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.geometry.rotations import left_jacobian, log_rotation
from aatri.observations.geodetic.lengths import horizontal, slope
from aatri.observations.geodetic.sights import Sights, observed_sights
from aatri.observations.level import PLANE
from aatri.observations.observed import Observed, named
from aatri.observations.ties import BODY


@dataclass(frozen=True)
class Lengths:
    """Distances of one kind.

    Attributes
    ----------
    kind : str
    sights : Sights
    plan : (n,) bool
        Horizontal ones.
    """

    kind: str
    sights: Sights
    plan: Bool

    @property
    def levelled(self) -> Bool:
        """Distances that mean something only where it is known what is up."""
        return np.asarray(self.plan | (self.sights.target_height_m != self.sights.station_height_m))

    def take(self, rows: Int) -> Lengths:
        """The chosen ones."""
        return Lengths(self.kind, self.sights.take(rows), self.plan[rows])

    def between(self, start: Int, end: Int) -> Lengths:
        """The same between ground points of other numbers."""
        no = np.zeros(len(start), dtype=bool)
        ends = replace(self.sights, station=start.astype(np.int32), target=end.astype(np.int32))
        return replace(self, sights=replace(ends, station_is_image=no, target_is_image=no))

    def observed(self) -> Iterator[Observed]:
        """As observations of points and images."""
        for some, measured in ((~self.plan, slope), (self.plan, horizontal)):
            yield from observed_sights(self.kind, self.sights.take(some), PLANE, measured, "m")


@dataclass(frozen=True)
class GivenAttitudes:
    """Observed rotations of images of a body, the one there is.

    Attributes
    ----------
    kind : str
    row : (n,) int
        In exterior.
    image : (n,) str
    strip_from_image : (n, 3, 3) float64
    observed_rotation : (n, 3, 3) float64
        Ground from image.
    turning : (n, 3, 3) float64
        G, columns.
    covariance_rad2 : (n, 3, 3) float64, rad^2
        Of the angles, with the errors of the images in their strip.
    """

    kind: str
    row: Int
    image: Text
    strip_from_image: Float
    observed_rotation: Float
    turning: Float
    covariance_rad2: Float

    def observed(self) -> Observed:
        """As observations of the rotation of the body; no ground point is concerned."""
        n, back = len(self.row), np.linalg.inv(self.turning)

        def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
            poses: Any = state[BODY]
            turned = poses.rotation[0] @ self.strip_from_image[rows]
            w = log_rotation(turned @ self.observed_rotation[rows].swapaxes(1, 2))
            J = np.zeros((len(rows), 3, 7))
            J[:, :, 3:6] = back[rows] @ np.linalg.inv(left_jacobian(w))
            return np.einsum("nij,nj->ni", back[rows], w), (J,)

        whitener = np.linalg.inv(np.linalg.cholesky(self.covariance_rad2))
        records = Records(self.kind, ((BODY, np.zeros(n, dtype=np.int32)),), evaluate, whitener, np.ones(n, dtype=bool))
        return Observed(records, self.row, named(self.image), "rad")
