"""Slope distances between ground points or projection centres, observed or exact.

    v = |X_to + h_to e - X_from - h_from e| - d,    dv/dX_to = u,   dv/dX_from = -u,   u the unit vector of the line

e is the vertical, h are the heights of instrument and target above their points. Distances of geodetic.csv and those of
relative_control.yaml are two kinds, for their rows are in two tables. Of standard deviation zero they are exact: they
are demanded, not observed. Source: Kraus, Photogrammetry; docs/formulas.md 5.4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.ids import rows_of
from aatri.observations.observed import NEARLY_EXACT, Given, Observed, named
from aatri.observations.poses import POINT, POSE

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

GEODETIC, RELATIVE = "distance", "relative_distance"
"""Names of the kinds."""

USES = ("geodetic:distance", "geodetic:distance_to_image", "geodetic.heights", "relative_control:distance")


@dataclass(frozen=True)
class Distances:
    """Distances between two ends.

    Attributes
    ----------
    row : (n,) int
        Row in the Block's geodetic or relative_control.
    start, end : (n,) int
        Rows in points or images.
    start_is_image, end_is_image : (n,) bool
    start_height_m, end_height_m : (n,) float64, m
    value_m, sigma_m : (n,) float64, m
        Sigma 0: exact.
    names : (n,) str
        `A-B`.
    """

    row: Int
    start: Int
    end: Int
    start_is_image: Bool
    end_is_image: Bool
    start_height_m: Float
    end_height_m: Float
    value_m: Float
    sigma_m: Float
    names: Text

    def take(self, rows: Int | Bool) -> Distances:
        """The chosen distances."""
        return Distances(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def distances(given: Given) -> tuple[Observed, ...]:
    """Slope distances of geodetic.csv and of relative_control.yaml."""
    found: list[Observed] = []
    for kind, rows in ((GEODETIC, geodetic_distances(given.block)), (RELATIVE, relative_distances(given.block))):
        found += observed_distances(kind, rows)
    return tuple(found)


def geodetic_distances(block: Block) -> Distances:
    """Slope distances among the geodetic observations; those reduced to another surface are none."""
    g = block.geodetic
    row = np.flatnonzero((g.type == "distance") & (g.reduced == "no") & g.active)
    heights = [np.nan_to_num(h[row]) for h in (g.start_height_m, g.end_height_m)]
    return _between(block, row, g.start[row], g.end[row], g.start_kind[row], g.end_kind[row], heights, g.value[row],
                    g.sigma[row])  # fmt: skip


def relative_distances(block: Block) -> Distances:
    """Distances among the relative control."""
    control, members = block.relative_control, block.relative_control_members
    row = np.flatnonzero(control.type == "distance")
    first = np.searchsorted(members.condition, row)
    kind = np.where(members.part[first] == "images", "image", "point")
    none = np.zeros(len(row))
    return _between(block, row, members.id[first], members.id[first + 1], kind, kind, [none, none],
                    control.value[row], control.sigma[row])  # fmt: skip


def _between(
    block: Block, row: Int, start: Text, end: Text, start_kind: Text, end_kind: Text, heights: list[Float],
    value: Float, sigma: Float,
) -> Distances:  # fmt: skip
    def rows(names: Text, kinds: Text) -> Int:
        return np.where(kinds == "image", rows_of(names, block.images.id), rows_of(names, block.points.id))

    ends, images = (rows(start, start_kind), rows(end, end_kind)), (start_kind == "image", end_kind == "image")
    names = np.array([f"{a}-{b}" for a, b in zip(start, end)], dtype=np.str_)
    return Distances(row, ends[0], ends[1], images[0], images[1], heights[0], heights[1], value, sigma, names)


def observed_distances(kind: str, rows: Distances) -> Iterator[Observed]:
    """Distances as observations: exact ones apart, and those whose ends are of other groups of unknowns."""
    for exact in (False, True):
        for images in ((False, False), (False, True), (True, False), (True, True)):
            some = (rows.sigma_m == 0) == exact
            some = some & (rows.start_is_image == images[0]) & (rows.end_is_image == images[1])
            if some.any():
                chosen = rows.take(some)
                records = _records(kind, chosen, *(POSE if image else POINT for image in images))
                yield Observed(records, chosen.row, named(point=chosen.names), "m", exact=exact)


def _records(kind: str, rows: Distances, start: str, end: str) -> Records:
    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        line = _position(state, end)[rows.end[some]] - _position(state, start)[rows.start[some]]
        line[:, 2] += rows.end_height_m[some] - rows.start_height_m[some]
        length = np.linalg.norm(line, axis=1)
        u = line / length[:, None]
        v = length - rows.value_m[some]
        return v[:, None], (_derivative(start, -u), _derivative(end, u))

    sigma = np.where(rows.sigma_m > 0, rows.sigma_m, NEARLY_EXACT)
    active = np.ones(len(rows.row), dtype=bool)
    return Records(kind, ((start, rows.start), (end, rows.end)), evaluate, 1.0 / sigma[:, None], active)


def _position(state: State, group: str) -> Float:
    found: Any = state[group].position_m if group == POSE else state[group]
    return np.asarray(found)


def _derivative(group: str, by_position: Float) -> Float:
    """By the unknowns of the end, (n, 1, 3) or (n, 1, 6): a distance does not see how an image is turned."""
    turned = np.zeros((len(by_position), 3 if group == POSE else 0))
    return np.concatenate([by_position, turned], axis=1)[:, None, :]
