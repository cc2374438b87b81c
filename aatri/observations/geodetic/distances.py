"""Distances of geodetic.csv, slope and horizontal, with scale and addition constant where they belong to a group.

    v = (1 + m) d + a - d_observed,    d = |l| or sqrt(e^2 + n^2),    l the line in the axes of its station

l goes from instrument to target, h_from and h_to above their points. Distances of a `group` share a scale m and an
addition constant a, both free unless the options hold them. A slope distance that is `reduced: horizon` is a horizontal
one. Source: Kraus, Photogrammetry; docs/formulas.md 5.4.

Distances reduced to the map or to the ellipsoid: between the places below, whatever the heights of their ends.

    map        l = (E, N, 0)(B) - (E, N, 0)(A)
    ellipsoid  l = F(B) - F(A),    F(X) = X - h u,    s = 2 R asin(|l| / 2 R)
               dF/dX = M / (M + h) n n' + N / (N + h) e e'

u is the normal, h the ellipsoidal height; n, e are true north and east, M and N the radii of curvature, R their
geometric mean in the middle of the block. The arc of this sphere for the geodesic is right to 10 um over 10 km.

In a frame whose Z is the height both are lengths in its plane; there a distance on the ellipsoid is first enlarged by
the scale of the map in its middle. Source: Torge, Geodesy; docs/formulas.md 5.4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Float
from aatri.errors import AatriError, InputError
from aatri.ids import several
from aatri.notes import Note
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
    places_of_ends,
    sight_records,
    sights_of,
    slope,
)
from aatri.observations.level import Level, line_between
from aatri.observations.observed import ObservationSource, Observed, named
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.frames.tangent import TangentFrame
    from aatri.observations.observed import ObservationSource


NOTED = 0.1
"""Share of the standard deviation from which on there is a note of what is neglected."""

KIND, HORIZONTAL, CALIBRATION = "distance", "horizontal_distance", "distance_group"
"""Names of the kinds, and of the group of unknowns."""

USES = (
    *(f"geodetic:{kind}{end}" for kind in (KIND, HORIZONTAL) for end in ("", "_to_image")),
    *("geodetic.heights", "geodetic.group", "geodetic.reduced:distance"),
)


def in_map(level: Level, start: Float, end: Float, _a: Float, _b: Float) -> tuple[Float, Float, Float]:
    """Lines between places in the map, and their derivatives."""
    plan = np.array([1.0, 1.0, 0.0])
    (low, by_low), (high, by_high) = level.coordinates(start), level.coordinates(end)
    return (high - low) * plan, -by_low * plan[:, None], by_high * plan[:, None]


def on_ellipsoid(frame: TangentFrame, origin_m: Float) -> tuple[Between, Measured]:
    """Lines between the places below on the ellipsoid, and the length of their arcs."""
    at_origin = frame.up_at(np.asarray(origin_m)[None])
    radius = float(np.sqrt(np.prod(_radii(frame, at_origin))))

    def below(X: Float) -> tuple[Float, Float]:
        u, h = frame.up_at(X), frame.height_at(X)
        east, north, up = np.moveaxis(frame.true_axes_at(X.real), 2, 0)
        meridian, normal = _radii(frame, up)
        by_north, by_east = meridian / (meridian + h.real), normal / (normal + h.real)
        D = [k[:, None, None] * a[:, :, None] * a[:, None, :] for k, a in ((by_north, north), (by_east, east))]
        return X - h[:, None] * u, D[0] + D[1]

    def between(_level: Level, start: Float, end: Float, _a: Float, _b: Float) -> tuple[Float, Float, Float]:
        (low, by_low), (high, by_high) = below(start + origin_m), below(end + origin_m)
        return high - low, -by_low, by_high

    def arc(line: Float) -> tuple[Float, Float]:
        chord, by_line = slope(line)
        half = 0.5 * chord / radius
        return 2 * radius * np.arcsin(half), by_line / np.sqrt(1 - half**2)[:, None]

    return between, arc


def _radii(frame: TangentFrame, up: Float) -> tuple[Float, Float]:
    """Radii of curvature in the meridian and across it where the normal is `up`."""
    sine = up @ frame.axes[2]
    w = 1 - frame.body.e2 * sine**2
    return frame.body.a_m * (1 - frame.body.e2) / w**1.5, frame.body.a_m / np.sqrt(w)


def map_scale(frame: TangentFrame, xyz: Float) -> Float:
    """Length in the map over length on the ground, (n,), at places given in coordinates of the block."""
    D = frame.derivatives_at(frame.from_block(xyz))
    return np.asarray(np.sqrt(np.abs(np.linalg.det(D[:, :2, :2]))))


def in_the_plane(source: ObservationSource, rows: Sights) -> Sights:
    """Distances on the ellipsoid as they are in the plane of a map."""
    if source.geodesy is None or source.frame is not None:
        return rows
    middle = _middles(source, rows) * np.array([1.0, 1.0, 0.0])
    return replace(rows, value=rows.value * np.where(np.isfinite(middle[:, 0]), map_scale(source.geodesy, middle), 1.0))


def check_map(source: ObservationSource, rows: Sights) -> None:
    """Whether there is a map that distances can be reduced to.

    Raises
    ------
    InputError
        If the first frame of the block is geocentric.
    """
    if len(rows) and source.frame is not None and source.frame.geocentric:
        raise InputError(
            f"{several(len(rows), 'geodetic observation', 'is', 'are')} reduced to a map, but the "
            "block's first frame is none",
            where=f"geodetic.csv: {rows.names[0]}",
            remedy="make the map the first frame of block.yaml, or give observations that are not reduced",
        )


def not_reduced(source: ObservationSource, rows: Sights) -> tuple[Note, ...]:
    """What the scale of the map, in which the block is adjusted, does to distances that are not reduced to it."""
    if source.geodesy is None or source.frame is not None or not len(rows):
        return ()
    middle = _middles(source, rows)
    try:
        scale = map_scale(source.geodesy, middle)
    except AatriError:
        return ()
    effect = np.abs(scale - 1) * rows.value
    large = effect > NOTED * rows.sigma
    if not large.any():
        return ()
    worst = int(np.nanargmax(effect))
    text = (
        f"{several(len(rows), 'distance', 'is', 'are')} not reduced, and the adjustment is in a map of "
        f"scale {scale[worst]:.6f} here: "
        f"{large.sum()} are wrong by more than {NOTED:g} sigma, {rows.names[worst]} by {effect[worst]:.3g} m; "
        "earth_curvature: frame takes them as they are, `reduced: map` says that they are reduced"
    )
    return (Note("warning", text, tuple(rows.names[large].tolist())),)


def _middles(source: ObservationSource, rows: Sights) -> Float:
    """Middles of the lines, in the coordinates of the block; NaN where an end is unknown."""
    ends = places_of_ends(rows, source.start)
    return np.asarray(0.5 * (ends[0] + ends[1]) + source.origin_m)


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
