"""Given coordinates, and other values of unknowns, held against places of the adjustment, along the axes of the block.

    all three     v = D (X - X_given)
    some          v = x(X) - x_given

D is I where the adjustment is in the axes of the block, else it turns the residual into them (`placed` of the source).
Coordinates given in part have no place there; they are compared in the coordinates of the block, so that they stay
right at any distance from the origin; x is the map of the frame (`frames.expanded`).

Observed values of unknowns themselves: ground coordinates of control, priors of interior unknowns.

v = x - x_observed,    dv/dx = I
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Ids, State
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.arrays import Bool, Float, Int
from aatri.frames.expanded import Expanded
from aatri.observations.observed import ObservationSource, Observed, named


def value_records(
    name: str, group: str, block: Int, value: Float, covariance: Float, observed: Bool | None = None
) -> Records:
    """Records that observe the blocks of a group directly.

    Parameters
    ----------
    name : str
        Name of the observation type.
    group : str
        Group of unknowns, of plain numbers.
    block : (n,) int32
    value : (n, k) float64
        Only the observed components are looked at.
    covariance : (n, k, k) float64
    observed : (n, k) bool, optional
        Default: all.
    """
    used = np.ones(value.shape, dtype=bool) if observed is None else observed
    target = np.where(used, value, 0.0)
    derivative = np.eye(value.shape[1]) * used[:, :, None]

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        return np.where(used[rows], state[group][block[rows]] - target[rows], 0.0), (derivative[rows],)

    active = np.asarray(used.any(axis=1))
    whitener = whitener_of_covariances(covariance, used)
    return Records(name, ((group, block),), evaluate, whitener, active, linear=True)


def observed_priors(
    kind: str,
    group: str,
    ids: Ids,
    values: Float,
    covariance: Float,
    weighted: Bool,
    labels: tuple[str, ...],
    unit: str = "",
) -> tuple[Observed, ...]:
    """What is known beforehand of the weighted unknowns of a group, v = p - p_prior; nothing where none is weighted.

    Parameters
    ----------
    values, weighted : (n, k)
    covariance : (n, k, k) float64
        Only that among weighted unknowns is looked at.
    """
    rows = np.flatnonzero(weighted.any(axis=1)).astype(np.int32)
    if not len(rows):
        return ()
    records = value_records(kind, group, rows, values[rows], covariance[rows], weighted[rows])
    names = named(image=np.asarray(ids, dtype=np.str_)[rows])
    return (Observed(records, np.full(len(rows), -1), names, unit, components=labels),)


@dataclass(frozen=True)
class GivenCoordinates:
    """Given coordinates of n points or images."""

    used: Bool
    """(n, 3). Coordinates that are given."""
    place_m: Float
    """(n, 3), m. In the frame of the adjustment, reduced to its origin; zero where unknown."""
    derivatives: Float
    """(n, 3, 3). D."""
    expanded: Expanded | None
    """The map, where the adjustment is not in the block's own axes."""
    partial_m: Float
    """(n, 3), m. Coordinates of the block less the reference of the map, used of those given in part."""
    origin_m: Float
    """(3,), m."""

    @property
    def own_axes(self) -> Bool:
        """Whose scalars in the adjustment are the coordinates given, or all three together, (n,)."""
        return np.asarray(self.used.all(axis=1) | (self.expanded is None))

    def take(self, rows: Int) -> GivenCoordinates:
        """The chosen ones."""
        names = ("used", "place_m", "derivatives", "partial_m")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def residuals(self, X: Any, rows: Int) -> tuple[Any, Any]:
        """v and dv/dX at places of the adjustment.

        Parameters
        ----------
        X : (k, 3) float64, m
            Reduced to the origin.
        rows : (k,) int

        Returns
        -------
        v : (k, 3) float64, m
            Zero where not given.
        derivatives : (k, 3, 3) float64
        """
        D = self.derivatives[rows]
        if self.expanded is None:
            return np.where(self.used[rows], X - self.place_m[rows], 0.0), D
        v = np.einsum("nij,nj->ni", D, X - self.place_m[rows])
        part = np.flatnonzero(~self.own_axes[rows])
        if len(part):
            use = self.used[rows[part]]
            x, dx = self.expanded.coordinates(X[part] + self.origin_m)
            v[part] = np.where(use, x - self.partial_m[rows[part]], 0.0)
            D = D.astype(dx.dtype)
            D[part] = dx * use[:, :, None]
        return v, D


def in_own_axes(xyz_m: Float, origin_m: Float, used: Bool) -> GivenCoordinates:
    """Coordinates of an adjustment in the axes of the block."""
    place = np.where(used, xyz_m - origin_m, 0.0)
    return GivenCoordinates(used, place, np.eye(3) * used[:, :, None], None, place, origin_m)


def given_coordinates(source: ObservationSource, xyz_m: Float, used: Bool) -> GivenCoordinates:
    """Coordinates of the block in the adjustment.

    Parameters
    ----------
    xyz_m : (n, 3) float64, m
        In the frame of the block.
    used : (n, 3) bool
    """
    if source.frame is None:
        return in_own_axes(xyz_m, source.origin_m, used)
    reference = source.frame.to_block(source.origin_m[None])[0]
    complete = np.flatnonzero(used.all(axis=1))
    place, D = np.zeros_like(xyz_m), np.broadcast_to(np.eye(3), (len(xyz_m), 3, 3)).copy()
    placed, D[complete] = source.placed(xyz_m[complete])
    place[complete] = placed - source.origin_m
    return GivenCoordinates(used, place, D, Expanded(source.frame, reference), xyz_m - reference, source.origin_m)
