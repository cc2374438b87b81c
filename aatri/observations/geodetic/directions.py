"""Horizontal directions in sets, azimuths from grid north, and angles.

    direction  v = t - o - r,    azimuth  v = t - a,    angle  v = t(to) - t(from) - w,    t = atan2(e, n)

o is the orientation of the set, the bearing of its zero, an unknown that a rotation of the block about the vertical
turns with it. All count clockwise from north, in the horizon of the station; those that are `reduced: map` between the
places in the map. What reduces a direction to the ellipsoid is below a hundredth of a second, and is neglected.
Source: docs/formulas.md 5.4.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int, Text, finite_rows
from aatri.notes import Note
from aatri.observations.geodetic.reduced import check_map, in_map
from aatri.observations.geodetic.sights import (
    PLAN,
    Between,
    Calibrated,
    Sights,
    alike,
    around,
    bearing,
    observed_sights,
    places_of_ends,
    rows_of_ends,
    sight_records,
    sights_of,
)
from aatri.observations.level import Level, line_between
from aatri.observations.observed import ObservationSource, Observed, named
from aatri.observations.poses import POINT, POSE, by_unknowns, position

DIRECTION, AZIMUTH, ANGLE, ORIENTATION = "direction", "azimuth", "angle", "orientation"
"""Names of the kinds, and of the group of unknowns."""

USES = (
    *(f"geodetic:{kind}{end}" for kind in (DIRECTION, AZIMUTH, ANGLE) for end in ("", "_to_image")),
    "geodetic.heights",
    "geodetic.reduced:angular",
)


def directions(source: ObservationSource) -> tuple[Observed, ...]:
    """Directions of sets with an orientation each, azimuths and angles."""
    observed = list[Observed]()
    for rows, between in by_surface(source, sights_of(source.block, AZIMUTH)):
        observed += observed_sights(AZIMUTH, rows, source.level, bearing, "rad", PLAN, between)
    rows = sights_of(source.block, DIRECTION)
    if len(rows):
        observed += _oriented(source, rows)
    return (*observed, *_angles(source))


def by_surface(source: ObservationSource, rows: Sights) -> Iterator[tuple[Sights, Between]]:
    """Sights in the horizon of their stations, and those in the map, with the lines that they measure."""
    in_a_map = (rows.reduced == "map") & np.bool_(source.frame is not None)
    check_map(source, rows.take(in_a_map))
    for there, between in ((~in_a_map, line_between), (in_a_map, in_map)):
        if there.any():
            yield rows.take(there), between


def _oriented(source: ObservationSource, rows: Sights) -> Iterator[Observed]:
    """Directions of sets; the unknowns come with the first part."""
    ids, block = np.unique(rows.set, return_inverse=True)
    free = np.ones((len(ids), 1), dtype=bool)
    own: tuple[Unknowns, ...] = (
        Unknowns(
            ORIENTATION, free, ("orientation",), ids, _turned, generator=lambda state: _generator(state[ORIENTATION])
        ),
    )
    start: State = {ORIENTATION: orientation_start(rows, source.start, block, len(ids), source.level)[:, None]}
    number = dict(zip(ids.tolist(), range(len(ids))))
    notes = _lonely(ids, np.bincount(block, minlength=len(ids)))
    parts = [(part, exact, between) for sights, between in by_surface(source, rows) for part, exact in alike(sights)]
    for part, exact, between in parts:
        set_row = np.array([number[s] for s in part.set.tolist()], dtype=np.int32)
        own_set = Calibrated(ORIENTATION, set_row, _shown)
        records = sight_records(DIRECTION, part, source.level, bearing, own_set, angular=True, between=between)
        yield Observed(
            records,
            part.row,
            named(point=part.names),
            "rad",
            unknowns=own,
            start=start,
            exact=exact,
            sees=PLAN,
            notes=notes,
        )
        own, start, notes = (), {}, ()


def _lonely(ids: Text, count: Int) -> tuple[Note, ...]:
    """Sets of one direction find their own orientation, and tell nothing of their points."""
    lonely = tuple(ids[count == 1].tolist())
    text = "sets of a single direction determine their own orientation and nothing else; an azimuth or a second target"
    return (Note("warning", f"{text} would make them count", lonely),) if lonely else ()


def orientation_start(rows: Sights, start: State, block: Int, n: int, level: Level) -> Float:
    """Orientation of each set from the start of its stations and targets, (n,) rad: 0 where nothing is known."""
    ends = places_of_ends(rows, start)
    has_line = finite_rows(np.hstack([end[:, :2] for end in ends]))
    zero = np.zeros(len(rows))
    line = line_between(level, np.nan_to_num(ends[0]), np.nan_to_num(ends[1]), zero, zero)[0]
    has_line &= np.asarray((line[:, :2] != 0).any(axis=1))
    o = np.where(has_line, bearing(np.where(has_line[:, None], line, 1.0))[0] - rows.value, 0.0)
    east, north = (np.bincount(block[has_line], f(o[has_line]), n) for f in (np.sin, np.cos))
    return np.asarray(np.arctan2(east, north))


def _shown(t: Float, unknowns: Float) -> tuple[Float, Float, Float]:
    return t - unknowns[:, 0], np.ones_like(t), -np.ones_like(unknowns)


def _turned(value: Float, step: Float) -> Float:
    return around(add_step(value, step))


def _generator(values: Float) -> Float:
    """A block turned counter-clockwise about the vertical has smaller bearings, (n, 1, 7)."""
    moves = np.zeros((len(values), 1, 7))
    moves[:, 0, 5] = -1.0
    return moves


def _angles(source: ObservationSource) -> Iterator[Observed]:
    """Angles at a vertex, from one target to another."""
    block, g = source.block, source.block.geodetic
    row = np.flatnonzero((g.type == ANGLE) & g.active)
    if not len(row):
        return
    vertex = rows_of_ends(block, g.via[row], np.full(len(row), "point"))
    ends = [rows_of_ends(block, ids[row], kind[row]) for ids, kind in ((g.start, g.start_kind), (g.end, g.end_kind))]
    names = np.array([f"{a}-{v}-{b}" for a, v, b in zip(g.start[row], g.via[row], g.end[row])], dtype=np.str_)
    reduced = (g.reduced[row] == "map") & np.bool_(source.frame is not None)
    surfaces: tuple[Between, ...] = (line_between, in_map)
    for back, fore, between in itertools.product((False, True), (False, True), surfaces):
        of_ends = ((g.start_kind[row] == "image") == back) & ((g.end_kind[row] == "image") == fore)
        rows = np.flatnonzero(of_ends & (reduced == (between is in_map)))
        if len(rows):
            groups = (POINT, *(POSE if image else POINT for image in (back, fore)))
            blocks = (vertex[rows], *(end[rows] for end in ends))
            yield _observed_angles(source, row[rows], groups, blocks, names[rows], between)


def _observed_angles(
    source: ObservationSource, row: Int, groups: tuple[str, ...], blocks: tuple[Int, ...], names: Text, between: Between
) -> Observed:
    g, level = source.block.geodetic, source.level
    above = [np.nan_to_num(h[row]) for h in (g.start_height_m, g.end_height_m)]
    value = g.value[row]

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        at, backsight, foresight = (position(state, group)[b[rows]] for group, b in zip(groups, blocks))
        v, by_vertex, by_targets = -value[rows], np.zeros((len(rows), 1, 3)), list[Float]()
        for sign, target, h in ((-1.0, backsight, above[0]), (1.0, foresight, above[1])):
            line, by_start, by_end = between(level, at, target, np.zeros(len(rows)), h[rows])
            t, by_line = bearing(line)
            v = v + sign * t
            by_vertex = by_vertex + sign * by_line[:, None, :] @ by_start
            by_targets.append(sign * by_line[:, None, :] @ by_end)
        J = (by_unknowns(group, d) for group, d in zip(groups, (by_vertex, *by_targets)))
        return around(v)[:, None], tuple(J)

    records = Records(
        ANGLE, tuple(zip(groups, blocks)), evaluate, 1.0 / g.sigma[row][:, None], np.ones(len(row), dtype=bool)
    )
    return Observed(records, row, named(point=names), "rad", sees=PLAN)
