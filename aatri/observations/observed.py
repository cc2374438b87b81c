"""Observations of one kind, as all that adjusts, tests or tells them takes them.

A kind of observation is one file of this folder and one line of `kinds`. The file has a function

    def distances(given: ObservationSource, options: DistanceOptions) -> tuple[Observed, ...]

which takes its rows out of the tables of the Block. Observed and exact rows, and rows that touch other groups of
unknowns, are one `Observed` each. Nothing else needs to know the kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int, Text
from aatri.frames.tangent import TangentFrame
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.level import PLANE, Level, tangent_level
from aatri.observations.parameters import ParameterRows
from aatri.units import EARTH_RADIUS_M

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.artifacts.image_points import ImagePoints

Names = Callable[[Int], tuple[Text, Text]]
"""Rows -> what tables and messages call them: ids of image and point, empty where there is none."""

Veto = Callable[[State, State], str]

NEARLY_EXACT = 1e-6
"""Standard deviation, m or rad, with which a rejected exact coordinate is held against its prediction."""


@dataclass(frozen=True)
class ObservationSource:
    """What observations are taken from."""

    block: Block
    image_points: ImagePoints | None
    """None for a network without images."""
    origin_m: Float
    """(3,), m. Origin of the adjustment, near the block; all coordinates below it are reduced to it."""
    start: State
    """Poses and ground points at the start, reduced to the origin; NaN where unknown."""
    parameters: tuple[ParameterRows, ...] = ()
    """Unknown parameters of images and cameras."""
    level: Level = PLANE
    """What is up, north and height in the frame of the adjustment."""
    frame: TangentFrame | None = None
    """The frame of the adjustment, where it is not that of the block: `start` is in it, and the origin is its own."""
    geodesy: TangentFrame | None = None
    """A tangent frame of the block's CRS, also where the adjustment is in the block's own frame; None if it has none.
    """
    notes: tuple[Note, ...] = ()
    """What there is to say of the start."""
    rays: ImagePointRows | None = None
    """All image points; None for a network without images."""

    def axes_at(self, place: Float) -> Float:
        """B: the axes of the block at places of the adjustment (not reduced), (n, 3, 3), columns."""
        if self.frame is None:
            return np.broadcast_to(np.eye(3), (len(place), 3, 3))
        return self.frame.axes_at(np.where(np.isfinite(place), place, 0.0))

    def north_east_down_at(self, place: Float) -> Float:
        """North (true, or of the grid where headings count from it), east, down in the axes of the block, columns."""
        ned = np.broadcast_to(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), (len(place), 3, 3))
        if self.geodesy is None or self.block.heading == "grid":
            return ned
        X = place if self.frame is not None else self.geodesy.from_block(place)
        X = np.where(np.isfinite(X), X, 0.0)
        return np.asarray(self.geodesy.axes_at(X).swapaxes(1, 2) @ self.geodesy.true_axes_at(X) @ ned)

    def placed(self, xyz: Float) -> tuple[Float, Float]:
        """Coordinates of the block in the adjustment, and D, the derivatives of the block's coordinates there.

        A coordinate observed in the block has the residual D (X - X_observed), along the axes of the block: exact but
        for terms of second order in the residual (its square over 2 R: 0.1 um at 1 m).

        Returns
        -------
        xyz_m : (n, 3) float64, m
            In the frame of the adjustment, not reduced to its origin.
        derivatives : (n, 3, 3) float64
        """
        if self.frame is None:
            return xyz, np.broadcast_to(np.eye(3), (len(xyz), 3, 3))
        placed = self.frame.from_block(xyz)
        return placed, self.frame.derivatives_at(placed)


@dataclass(frozen=True)
class Holds:
    """Scalars that exact observations fix: they are held at their values."""

    group: str
    block: Int
    """(n,)."""
    scalar: Bool
    """(n, k)."""
    value: Float
    """(n, k). Reduced to the origin."""


@dataclass(frozen=True)
class Spread:
    """Covariances that turn with unknowns, and that an adjustment may add a variance to: those of points of bodies."""

    values: Float
    """(n, 3), m^2. Eigenvalues."""
    vectors: Float
    """(n, 3, 3). Eigenvectors, by columns."""
    at: Callable[[State], Spread]
    """State -> the same there."""


@dataclass(frozen=True)
class Observed:
    """Observations of one kind; coordinates reduced to the origin of the adjustment."""

    records: Records
    """Its name is the kind: of residuals, suspects, messages, report."""
    row: Int
    """(n,). Row of each in its table of the Block; -1 if it has none."""
    names: Names
    unit: str
    """Of its residuals."""
    components: tuple[str, ...] = ()
    """Names of the components of a record where they are parameters and not coordinates."""
    unknowns: tuple[Unknowns, ...] = ()
    start: Mapping[str, Any] = field(default_factory=dict)
    """Unknowns of its own: drift, additional parameters ...; their start."""
    exact: bool = False
    """Demanded, not observed."""
    holds: Holds | None = None
    """Coordinates that are demanded, row by row as the records."""
    rejected: Bool | None = None
    """(n,). Rejected earlier: not used, but predicted, and held against the prediction."""
    veto: Callable[[Int], Veto] | None = None
    """Rows -> (old state, new state) -> why a step is refused on account of them, or an empty text."""
    unreduced: Observed | None = None
    """The same with nothing rejected."""
    group: Text | None = None
    """(n,) str. Group of observations that the table names, empty where it names none."""
    parts: tuple[tuple[str, tuple[int, ...]], ...] = ()
    """Components that are measured apart, and so have standard deviations of their own: plan and height."""
    sees: tuple[bool, bool, bool] | Bool = (True, True, True)
    """(bool, bool, bool) or (n, 3). Which coordinates of ground points it can see: what no observation sees is no
    unknown."""
    notes: tuple[Note, ...] = ()
    """What there is to say of them before they are adjusted."""
    units: tuple[str, ...] = ()
    """Of the components, where they differ."""
    refitted: Callable[[State], Observed] | None = None
    """The same with its own unknowns, a shape, fitted to the points of another start."""
    determined: Callable[[Sequence[Observed]], Observed] | None = None
    """All observations -> the same without the unknowns that they and it do not determine together."""
    spread: Spread | None = None
    """Covariances, where they are not those of the records."""
    set_rows: Int | None = None
    """(n, k). Rows of the table that each record joins, of which `row` is the first; else `row` is all."""
    rejected_in_set: Bool | None = None
    """(n, k). Which of these rows an earlier stage has rejected."""

    @property
    def kind(self) -> str:
        """Name of the kind."""
        return self.records.name

    @property
    def is_measured(self) -> bool:
        """Whether these are measurements, single or correlated ones: neither conditions nor what is known before."""
        return not self.exact and (not self.components or self.set_rows is not None)

    def label(self, row: int) -> str:
        """What messages call one of them: image/point, or the one there is."""
        image, point = self.names(np.array([row]))
        return "/".join(name for name in (str(image[0]), str(point[0])) if name)

    def __len__(self) -> int:
        return len(self.row)

    def take(self, rows: Int) -> Observed:
        """The chosen ones."""

        def names(chosen: Int) -> tuple[Text, Text]:
            return self.names(rows[chosen])

        sees: tuple[bool, bool, bool] | Bool = self.sees[rows] if isinstance(self.sees, np.ndarray) else self.sees
        h, joins, rejected_in_set = self.holds, self.set_rows, self.rejected_in_set
        holds = None if h is None else replace(h, block=h.block[rows], scalar=h.scalar[rows], value=h.value[rows])
        taken = replace(self, records=self.records.take(rows), row=self.row[rows], names=names, sees=sees, holds=holds)
        if joins is None:
            return taken
        return replace(
            taken, set_rows=joins[rows], rejected_in_set=None if rejected_in_set is None else rejected_in_set[rows]
        )

    def demanded(self) -> Bool:
        """Components that are exact, (n, m)."""
        if self.exact:
            return self.records.observed_components()
        empty = np.zeros((len(self), self.records.rows), dtype=bool)
        return empty if self.holds is None else self.holds.scalar & self.records.active[:, None]

    def sigmas(self) -> Float:
        """Standard deviations a priori, (n, m): 0 exact, NaN not observed."""
        if self.spread is not None:
            return np.asarray(np.sqrt(np.einsum("nij,nj->ni", self.spread.vectors**2, self.spread.values)))
        exact = self.holds.scalar if self.holds is not None else np.zeros((len(self), self.records.rows), dtype=bool)
        return np.where(exact | self.exact, 0.0, self.records.sigmas())

    def covariances(self) -> Float:
        """Covariances a priori, (n, m, m): zero where exact, and where not observed."""
        if self.spread is not None:
            V = self.spread.vectors
            return np.asarray(V * self.spread.values[:, None, :] @ V.swapaxes(1, 2))
        used = np.isfinite(self.records.sigmas()) & ~self.demanded()
        both = used[:, :, None] & used[:, None, :]
        back = np.linalg.inv(np.where(both, full_whitener(self.records.whitener), np.eye(self.records.rows)))
        return np.where(both, back @ back.swapaxes(1, 2), 0.0)

    def without(self, rejected: Bool) -> Observed:
        """Without the rejected rows; exact coordinates among them are no longer held."""
        if not rejected.any():
            return self
        records = replace(self.records, active=self.records.active & ~rejected)
        holds = self.holds
        if holds is not None:
            row, component = np.nonzero(holds.scalar & rejected[:, None])
            root = full_whitener(records.whitener).copy()
            root[row, component, component] = 1.0 / NEARLY_EXACT
            records = replace(records, whitener=root)
            holds = replace(holds, scalar=holds.scalar & ~rejected[:, None])
        return replace(self, records=records, holds=holds, rejected=rejected, unreduced=self.unreduced or self)

    def again(self) -> Observed:
        """With all that was rejected in use again; the start stays."""
        return self if self.unreduced is None else replace(self.unreduced, start=self.start)


def full_whitener(whitener: Float) -> Float:
    """A whitener as matrices, (n, m, m), also where the components are independent."""
    return whitener if whitener.ndim == 3 else whitener[:, :, None] * np.eye(whitener.shape[1])


def named(image: Text | None = None, point: Text | None = None) -> Names:
    """Names given row by row."""

    def names(rows: Int) -> tuple[Text, Text]:
        empty = np.full(len(rows), "")
        return (empty if image is None else image[rows], empty if point is None else point[rows])

    return names


def level_of(frame: TangentFrame | None, geodesy: TangentFrame | None, origin_m: Float) -> Level:
    """What is up: along the normals in a tangent frame; Z in any other, over a curved earth where it is a map's."""
    if frame is not None:
        return tangent_level(frame, origin_m)
    return PLANE if geodesy is None else replace(PLANE, curvature_per_m=1.0 / EARTH_RADIUS_M)
