"""Sights: observations from a station to a target, as rows of geodetic.csv, whatever is measured along them.

Stations and targets are ground points or projection centres; an angle has two targets. Every kind of geodetic
observation is a function of the line in the axes of its station, `aatri.observations.level`.

Values measured along a line (e, n, u) in the axes of its station, with their derivatives by it.

    slope distance       d = |l|                  horizontal distance   s = sqrt(e^2 + n^2)
    direction, azimuth   t = atan2(e, n)          zenith angle          z = atan2(s, u)

Source: docs/formulas.md 5.4; Kraus, Photogrammetry.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.ids import rows_of
from aatri.observations.level import Level, line_between
from aatri.observations.observed import NEARLY_EXACT, Observed, named
from aatri.observations.poses import POINT, POSE, by_unknowns, position

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


ALL, PLAN, HEIGHT = (True, True, True), (True, True, False), (False, False, True)
"""Which coordinates of a point an observation can see."""


def slope(line: Float) -> tuple[Float, Float]:
    """Length of the line, m."""
    length = np.sqrt(np.einsum("ni,ni->n", line, line))
    return length, line / length[:, None]


def horizontal(line: Float) -> tuple[Float, Float]:
    """Length of the line in the horizon of the station, m."""
    plan = line * np.array([1.0, 1.0, 0.0])
    return slope(plan)


def bearing(line: Float) -> tuple[Float, Float]:
    """Angle from north, clockwise, rad."""
    e, n = line[:, 0], line[:, 1]
    square = e**2 + n**2
    return np.arctan2(e, n), np.column_stack([n / square, -e / square, np.zeros_like(e)])


def zenith(line: Float) -> tuple[Float, Float]:
    """Angle from the vertical, rad."""
    e, n, u = line.T
    s, square = np.sqrt(e**2 + n**2), (line**2).sum(axis=1)
    return np.arctan2(s, u), np.column_stack([u * e / s, u * n / s, -s]) / square[:, None]


@dataclass(frozen=True)
class Sights:
    """Lines from stations to targets."""

    row: Int
    """(n,). Row in the Block's table."""
    station: Int
    target: Int
    """(n,). Rows in points or images."""
    station_is_image: Bool
    target_is_image: Bool
    """(n,)."""
    station_height_m: Float
    target_height_m: Float
    """(n,), m."""
    value: Float
    sigma: Float
    """(n,), m or rad. Sigma 0: exact."""
    names: Text
    """(n,) str. `A-B`."""
    set: Text
    group: Text
    """(n,) str."""
    reduced: Text
    """(n,) bool. Reduced to the horizon, the ellipsoid or the map."""

    def take(self, rows: Int | Bool) -> Sights:
        """The chosen sights."""
        return replace(self, **{name: getattr(self, name)[rows] for name in self.__dataclass_fields__})

    def __len__(self) -> int:
        return len(self.row)


def sights_of(block: Block, *types: str) -> Sights:
    """Rows of geodetic.csv in use of some types."""
    g = block.geodetic
    row = np.flatnonzero(np.isin(g.type, types) & g.active)
    return Sights(
        row=row,
        station=rows_of_ends(block, g.start[row], g.start_kind[row]),
        target=rows_of_ends(block, g.end[row], g.end_kind[row]),
        station_is_image=g.start_kind[row] == "image",
        target_is_image=g.end_kind[row] == "image",
        station_height_m=np.nan_to_num(g.start_height_m[row]),
        target_height_m=np.nan_to_num(g.end_height_m[row]),
        value=g.value[row],
        sigma=g.sigma[row],
        names=np.array([f"{a}-{b}" for a, b in zip(g.start[row], g.end[row])], dtype=np.str_),
        set=g.set[row],
        group=g.group[row],
        reduced=g.reduced[row],
    )


def places_of_ends(rows: Sights, start: State) -> list[Float]:
    """Stations, and targets, at the start of an adjustment, (n, 3) each; NaN unknown."""
    ends = []
    for image, at in ((rows.station_is_image, rows.station), (rows.target_is_image, rows.target)):
        ends.append(np.full((len(rows), 3), np.nan))
        for group, of_group in ((POSE, image), (POINT, ~image)):
            if of_group.any():
                ends[-1][of_group] = position(start, group)[at[of_group]]
    return ends


def rows_of_ends(block: Block, names: Text, kinds: Text) -> Int:
    """Rows in images or points."""
    return np.where(kinds == "image", rows_of(names, block.images.id), rows_of(names, block.points.id))


def alike(sights: Sights) -> Iterator[tuple[Sights, bool]]:
    """Sights between ends of the same groups of unknowns, observed and exact ones apart; and whether they are exact."""
    for exact, at, to in itertools.product((False, True), repeat=3):
        alike_ones = ((sights.sigma == 0) == exact) & (sights.station_is_image == at) & (sights.target_is_image == to)
        if alike_ones.any():
            yield sights.take(alike_ones), exact


def groups_of(sights: Sights) -> tuple[str, str]:
    """Groups of unknowns of station and target of sights that are alike."""
    return (POSE if sights.station_is_image[0] else POINT), (POSE if sights.target_is_image[0] else POINT)


Measured = Callable[[Float], tuple[Float, Float]]
"""The line in the axes of the station (n, 3) -> value (n,) and its derivatives (n, 3)."""


Between = Callable[[Level, Float, Float, Float, Float], tuple[Float, Float, Float]]
"""(level, places and heights of instruments and targets) -> the line (n, 3), by station and by target (n, 3, 3)."""


@dataclass(frozen=True)
class Calibrated:
    """Further unknowns between the value computed from the line and what the instrument shows."""

    group: str
    """Group of unknowns."""
    block: Int
    """(n,)."""
    shown: Callable[[Float, Float], tuple[Float, Float, Float]]
    """(value (n,), unknowns (n, k)) -> what is shown (n,), its derivatives by value (n,) and by unknowns (n, k)."""


def sight_records(
    kind: str,
    sights: Sights,
    level: Level,
    measured: Measured,
    own: Calibrated | None = None,
    *,
    angular: bool = False,
    between: Between = line_between,
) -> Records:
    """Records of sights that are alike.

    Parameters
    ----------
    own : Calibrated, optional
    angular : bool
        Residuals are angles, taken between -pi and pi.
    between : callable
        The line that is measured.
    """
    at, to = groups_of(sights)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        start, end = position(state, at)[sights.station[rows]], position(state, to)[sights.target[rows]]
        heights = sights.station_height_m[rows], sights.target_height_m[rows]
        line, by_start, by_end = between(level, start, end, *heights)
        value, by_line = measured(line)
        by_own: tuple[Float, ...] = ()
        if own is not None:
            value, by_value, by_unknown = own.shown(value, state[own.group][own.block[rows]])
            by_line, by_own = by_line * by_value[:, None], (by_unknown[:, None, :],)
        v = value - sights.value[rows]
        ends = (by_unknowns(group, by_line[:, None, :] @ d) for group, d in ((at, by_start), (to, by_end)))
        return (around(v) if angular else v)[:, None], (*ends, *by_own)

    touches = ((at, sights.station), (to, sights.target), *(((own.group, own.block),) if own is not None else ()))
    return Records(kind, touches, evaluate, inverse_sigmas(sights.sigma), np.ones(len(sights), dtype=bool))


def inverse_sigmas(sigma: Float, rows: int = 1) -> Float:
    """Whitener of records whose components have one standard deviation, (n, rows); exact ones are nearly exact."""
    return np.repeat(1.0 / np.where(sigma > 0, sigma, NEARLY_EXACT)[:, None], rows, axis=1)


def around(angle: Float) -> Float:
    """Angles between -pi and pi."""
    return np.asarray(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))


def observed_sights(
    kind: str,
    sights: Sights,
    level: Level,
    measured: Measured,
    unit: str,
    sees: tuple[bool, bool, bool] = ALL,
    between: Between = line_between,
) -> Iterator[Observed]:
    """Sights without further unknowns as observations."""
    for part, exact in alike(sights):
        records = sight_records(kind, part, level, measured, angular=unit == "rad", between=between)
        yield Observed(records, part.row, named(point=part.names), unit, exact=exact, sees=sees)
