"""Distances of geodetic.csv, slope and horizontal, with scale and addition constant where they belong to a group.

    v = (1 + m) d + a - d_observed,    d = |l| or sqrt(e^2 + n^2),    l the line in the axes of its station

l goes from instrument to target, h_from and h_to above their points. Distances of a `group` share a scale m and an
addition constant a, both free unless the options hold them. A slope distance that is `reduced`: `horizon` is a
horizontal one. Those reduced to the map are lengths in its plane; those reduced to the ellipsoid are, in a frame that
knows no Earth, the same. Source: Kraus, Photogrammetry; docs/formulas.md 5.4.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic import Field

from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float
from aatri.observations.geodetic.lengths import horizontal, slope
from aatri.observations.geodetic.sights import (
    ALL,
    PLAN,
    Calibrated,
    Measured,
    Sights,
    alike,
    observed_sights,
    sight_records,
    sights_of,
)
from aatri.observations.level import Level
from aatri.observations.observed import Given, Observed, named
from aatri.options import Options

KIND, HORIZONTAL, CALIBRATION = "distance", "horizontal_distance", "distance_group"
"""Names of the kinds, and of the group of unknowns."""

USES = (
    "geodetic:distance", "geodetic:distance_to_image", "geodetic:horizontal_distance",
    "geodetic:horizontal_distance_to_image", "geodetic.heights", "geodetic.group", "geodetic.reduced:distance",
)  # fmt: skip


class DistanceOptions(Options):
    """Options of distances of a group."""

    scale: bool = Field(True, description="the distances of a group have a common scale, to be found")
    addition: bool = Field(True, description="the distances of a group have a common addition constant, to be found")


def distances(given: Given, options: DistanceOptions) -> tuple[Observed, ...]:
    """Distances of the geodetic observations."""
    rows = sights_of(given.block, KIND, HORIZONTAL)
    type_ = given.block.geodetic.type[rows.row]
    plane = (type_ == HORIZONTAL) | (rows.reduced != "no")
    found: list[Observed] = []
    for kind, some, measured, sees in ((KIND, ~plane, slope, ALL), (HORIZONTAL, plane, horizontal, PLAN)):
        grouped = some & (rows.group != "") & (options.scale | options.addition)
        found += observed_sights(kind, rows.take(some & ~grouped), given.level, measured, "m", sees)
        if grouped.any():
            found += _calibrated(kind, rows.take(grouped), given.level, measured, sees, options)
    return tuple(found)


def _calibrated(
    kind: str, rows: Sights, level: Level, measured: Measured, sees: tuple[bool, bool, bool], options: DistanceOptions
) -> Iterator[Observed]:
    """Distances of groups; the unknowns come with the first part."""
    ids = np.unique(rows.group)
    name = f"{CALIBRATION}_{kind}" if kind != KIND else CALIBRATION
    free = np.tile([options.scale, options.addition], (len(ids), 1))
    own: tuple[Unknowns, ...] = (Unknowns(name, free, ("scale", "addition"), ids, add_step,
                                          generator=lambda state: _generator(state[name])),)  # fmt: skip
    start: State = {name: np.zeros((len(ids), 2))}
    number = dict(zip(ids.tolist(), range(len(ids))))
    for part, exact in alike(rows):
        of = np.array([number[g] for g in part.group.tolist()], dtype=np.int32)
        records = sight_records(kind, part, level, measured, Calibrated(name, of, _shown))
        yield Observed(records, part.row, named(point=part.names), "m", unknowns=own, start=start, exact=exact,
                       sees=sees)  # fmt: skip
        own, start = (), {}


def _shown(distance: Float, unknowns: Float) -> tuple[Float, Float, Float]:
    scale, addition = unknowns.T
    by_unknowns = np.column_stack([distance, np.ones_like(distance)])
    return (1 + scale) * distance + addition, 1 + scale, by_unknowns


def _generator(values: Float) -> Float:
    """A larger block has a smaller scale of its distances, (n, 2, 7)."""
    found = np.zeros((len(values), 2, 7))
    found[:, 0, 6] = -(1 + values[:, 0])
    return found
