"""Points of strips and given ground coordinates, as observations of ground points.

A strip's point, brought to the ground with the strip's unknowns t, and a given coordinate are both observations of the
same unknown ground point X:

    v = X - x_o(t),     dv/dX = I,  dv/dt = -dx_o/dt             strips' points, weight (C_o + tau^2 I)^-1
    v = X - X_given,    dv/dX = I                                 control, positions, weight C^-1

X is eliminated by the adjustment. For k strips of equal weight that leaves the factor (I - 11'/k): own block (k-1)/k,
mutual block -1/k, for any number of strips (docs/formulas.md 4.3). X is reduced to a place of its own, so that it
keeps the digits of small discrepancies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from aatri.adjustment.records import Records, Weigh
from aatri.adjustment.small_matrices import inverse_cholesky
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int
from aatri.observations.coordinates import value_records
from aatri.orientation.free_block.kernels.eigen import eigen

S = TypeVar("S")

STRIP, POINT = "strip", "point"
EXACT = 1e-2
"""Standard deviation of exact control, as a share of that of the strips' points: its residuals stay below 1e-4 of the
discrepancies, and its redundancy can still be told from rounding."""


@dataclass(frozen=True)
class Ties(Generic[S]):
    """Points of strips as functions of the strips' unknowns.

    Attributes
    ----------
    strip, point : (n,) int32
    on_ground : callable
        (state, rows) -> ground coordinates (n, 3).
    derivatives : callable
        (state, rows) -> their derivatives by the strip's unknowns (n, 3, k).
    spectrum : callable
        state -> eigenvalues (n, 3), m^2, and eigenvectors (n, 3, 3), by columns, of the covariances on the ground.
    unknowns : Unknowns
        The group of the strips' unknowns, named `STRIP`.
    n_points : int
    bend_m : callable, optional
        (old state, new state) -> bound of how far any ground coordinate departs from the linear model of the old state,
        m. None where they are linear.
    compiled : callable, optional
        (order, what the points of the ties are reduced to in that order, (n, 3)) -> faster lane, see
        adjustment.records.
    prior : Records, optional
        What is known of the strips' unknowns beforehand.
    """

    strip: Int
    point: Int
    on_ground: Callable[[S, Int], Float]
    derivatives: Callable[[S, Int], Float]
    spectrum: Callable[[S], tuple[Float, Float]]
    unknowns: Unknowns
    n_points: int
    bend_m: Callable[[S, S], float] | None
    compiled: Callable[[Int, Float], Weigh] | None = None
    prior: Records | None = None

    @property
    def rows(self) -> Int:
        """All rows."""
        return np.arange(len(self.strip))


class Given(Protocol):
    """What is given of the ground, of one kind: coordinates here, other things in `given_relations`."""

    @property
    def kind(self) -> str:
        """Name of its records."""

    @property
    def given(self) -> Bool:
        """Components that are given, (n, 3)."""

    @property
    def variance(self) -> Float:
        """Trace of the covariance of each, (n,)."""

    def records(self, base_m: Float) -> Records:
        """Records of ground points reduced to `base_m`, (n_points, 3); not yet weighted."""

    def whitener(self, typical_m2: float) -> Float:
        """T with T'T = C^-1, where a coordinate of a strip's point typically has the variance `typical_m2`."""


@dataclass(frozen=True)
class GivenPoints:
    """Given ground coordinates of one kind.

    Attributes
    ----------
    kind : str
    point : (n,) int
        Number of the point among those of the ties.
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
        Zero where exact.
    given : (n, 3) bool
        Coordinates that are given: all, plan only, height only.
    """

    kind: str
    point: Int
    xyz_m: Float
    covariance_m2: Float
    given: Bool

    @property
    def variance(self) -> Float:
        """Trace of each covariance, m^2."""
        return np.asarray(np.einsum("nii->n", np.nan_to_num(self.covariance_m2)))

    def records(self, base_m: Float) -> Records:
        """Records of coordinates."""
        return given_records(self, base_m)

    def whitener(self, typical_m2: float) -> Float:
        """See `given_whitener`."""
        return given_whitener(self, typical_m2)


def tie_records(ties: Ties[S], base_m: Float) -> Records:
    """Records of the strips' points; the ground points are reduced to `base_m`, (n_points, 3)."""
    eye = np.eye(3)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        point = ties.point[rows]
        v = state[POINT][point] - (ties.on_ground(state[STRIP], rows) - base_m[point])
        return v, (-ties.derivatives(state[STRIP], rows), np.broadcast_to(eye, (len(rows), 3, 3)))

    n = len(ties.strip)
    touches = ((STRIP, ties.strip), (POINT, ties.point))
    unit = np.broadcast_to(np.eye(3), (n, 3, 3))  # weighted later, see `tie_whitener`
    lane = ties.compiled

    def compiled(order: Int) -> Weigh:
        assert lane is not None
        return lane(order, np.ascontiguousarray(base_m[ties.point[order]]))

    used = np.ones(n, dtype=bool)
    return Records("strip_tie", touches, evaluate, unit, used, None if lane is None else compiled,
                   linear=ties.bend_m is None)  # fmt: skip


def given_records(given: GivenPoints, base_m: Float) -> Records:
    """Records of given coordinates."""
    point = given.point.astype(np.int32)
    unit = np.broadcast_to(np.eye(3), given.covariance_m2.shape)  # weighted later, see `given_whitener`
    return value_records(given.kind, POINT, point, given.xyz_m - base_m[point], unit, given.given)


def spectrum_of(covariance: Float) -> tuple[Float, Float]:
    """Eigenvalues (n, 3), none negative, and eigenvectors by columns (n, 3, 3) of covariances (n, 3, 3)."""
    values, vectors = np.empty(covariance.shape[:2]), np.empty(covariance.shape)
    eigen(0, len(values), np.ascontiguousarray(covariance, dtype=np.float64), values, vectors)
    return np.maximum(values, 0.0), vectors


def tie_whitener(eigenvalues: Float, eigenvectors: Float, tau_m: float) -> Float:
    """T with T'T = (C + tau^2 I)^-1; of equal weights where there is neither."""
    values = eigenvalues + tau_m**2
    if not values.any():
        values = np.ones_like(values)
    return np.divide(eigenvectors.swapaxes(1, 2), np.sqrt(values)[:, :, None], order="C")


def typical_variance(eigenvalues: Float, tau_m: float) -> float:
    """Median variance of a coordinate of the strips' points, m^2; 1 where they have none."""
    variance = float(np.median(eigenvalues @ np.full(3, 1 / 3))) + tau_m**2 if len(eigenvalues) else 0.0
    return variance or 1.0


def given_whitener(given: GivenPoints, typical_m2: float) -> Float:
    """T with T'T = C^-1; rows of coordinates that are not given are zero.

    Exact coordinates get `EXACT` times the standard deviation of the strips' points.
    """
    exact = np.einsum("nii->ni", given.covariance_m2) < EXACT**2 * typical_m2
    C = given.covariance_m2 + np.where(exact, EXACT**2 * typical_m2, 0.0)[:, :, None] * np.eye(3)
    both = given.given[:, :, None] & given.given[:, None, :]
    return np.asarray(np.where(both, inverse_cholesky(np.where(both, C, np.eye(3))), 0.0))
