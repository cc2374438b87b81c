"""Distances of geodetic.csv, slope and horizontal, with scale and addition constant where they belong to a group.

    v = (1 + m) d + a - d_observed,    d = |l| or sqrt(e^2 + n^2),    l the line in the axes of its station

l goes from instrument to target, h_from and h_to above their points. Distances of a `group` share a scale m and an
addition constant a, both free unless the options hold them. A slope distance that is `reduced: horizon` is a horizontal
one; those reduced to the map or the ellipsoid are in `reduced`. Source: Kraus, Photogrammetry; docs/formulas.md 5.4.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Float
from aatri.observations.geodetic.reduced import check_map, in_map, in_the_plane, not_reduced, on_ellipsoid
from aatri.observations.geodetic.sights import (
    ALL,
    PLAN,
    Between,
    Calibrated,
    Measured,
    Sights,
    alike,
    horizontal,
    observed_sights,
    sight_records,
    sights_of,
    slope,
)
from aatri.observations.level import Level, line_between
from aatri.observations.observed import ObservationSource, Observed, named
from aatri.options import Options

KIND, HORIZONTAL, CALIBRATION = "distance", "horizontal_distance", "distance_group"
"""Names of the kinds, and of the group of unknowns."""

USES = (
    *(f"geodetic:{kind}{end}" for kind in (KIND, HORIZONTAL) for end in ("", "_to_image")),
    *("geodetic.heights", "geodetic.group", "geodetic.reduced:distance"),
)


class DistanceOptions(Options):
    """Options of distances of a group."""

    scale: bool = Field(True, description="the distances of a group have a common scale, to be found")
    addition: bool = Field(True, description="the distances of a group have a common addition constant, to be found")


def distances(source: ObservationSource, options: DistanceOptions) -> tuple[Observed, ...]:
    """Distances of the geodetic observations."""
    rows = sights_of(source.block, KIND, HORIZONTAL)
    observed: list[Observed] = []
    for kind, ways in _ways(source, rows):
        own = _groups(kind, [way.rows for way in ways], options)
        calibrated: list[Observed] = []
        for way in ways:
            grouped = way.rows.group != "" if own else np.zeros(len(way.rows), dtype=bool)
            observed += observed_sights(
                kind, way.rows.take(~grouped), source.level, way.measured, "m", way.sees, way.between
            )
            if own and grouped.any():
                calibrated += _calibrated(kind, way, way.rows.take(grouped), source.level, own)
        if own:
            start = {own.name: np.zeros((len(own.ids), 2))}
            calibrated[0] = replace(calibrated[0], unknowns=(own,), start=start)
        observed += calibrated
    notes = not_reduced(source, rows.take(np.isin(rows.reduced, ("no", "horizon"))))
    if observed:
        observed[0] = replace(observed[0], notes=notes)
    return tuple(observed)


@dataclass(frozen=True)
class _Way:
    """Distances that are computed alike."""

    rows: Sights
    measured: Measured
    sees: tuple[bool, bool, bool]
    between: Between = line_between


def _ways(source: ObservationSource, rows: Sights) -> list[tuple[str, list[_Way]]]:
    """Distances by kind, and by what they are reduced to."""
    type_ = source.block.geodetic.type[rows.row]
    level_with = (rows.reduced == "horizon") | ((type_ == HORIZONTAL) & (rows.reduced == "no"))
    to_map, to_ellipsoid = (rows.take(rows.reduced == name) for name in ("map", "ellipsoid"))
    check_map(source, to_map)
    plane = [_Way(rows.take(level_with), horizontal, PLAN)]
    if source.frame is None:
        plane += [_Way(sights, horizontal, PLAN) for sights in (to_map, in_the_plane(source, to_ellipsoid))]
    else:
        between, arc = on_ellipsoid(source.frame, source.origin_m)
        plane += [_Way(to_map, slope, PLAN, in_map), _Way(to_ellipsoid, arc, PLAN, between)]
    return [(KIND, [_Way(rows.take((type_ == KIND) & (rows.reduced == "no")), slope, ALL)]), (HORIZONTAL, plane)]


def _groups(kind: str, parts: list[Sights], options: DistanceOptions) -> Unknowns | None:
    """Scale and addition constant of the groups of a kind, if there are any."""
    named = np.unique(np.concatenate([part.group for part in parts]))
    ids = named[named != ""]
    if not len(ids) or not (options.scale or options.addition):
        return None
    name = f"{CALIBRATION}_{kind}" if kind != KIND else CALIBRATION
    free = np.tile([options.scale, options.addition], (len(ids), 1))
    return Unknowns(name, free, ("scale", "addition"), ids, add_step, generator=lambda state: _generator(state[name]))


def _calibrated(kind: str, way: _Way, rows: Sights, level: Level, own: Unknowns) -> Iterator[Observed]:
    """Distances of groups."""
    number = {name: k for k, name in enumerate(own.ids)}
    for part, exact in alike(rows):
        group_row = np.array([number[g] for g in part.group.tolist()], dtype=np.int32)
        records = sight_records(
            kind, part, level, way.measured, Calibrated(own.name, group_row, _shown), between=way.between
        )
        yield Observed(records, part.row, named(point=part.names), "m", exact=exact, sees=way.sees)


def _shown(distance: Float, unknowns: Float) -> tuple[Float, Float, Float]:
    scale, addition = unknowns.T
    by_unknowns = np.column_stack([distance, np.ones_like(distance)])
    return (1 + scale) * distance + addition, 1 + scale, by_unknowns


def _generator(values: Float) -> Float:
    """A larger block has a smaller scale of its distances, (n, 2, 7)."""
    moves = np.zeros((len(values), 2, 7))
    moves[:, 0, 6] = -(1 + values[:, 0])
    return moves
