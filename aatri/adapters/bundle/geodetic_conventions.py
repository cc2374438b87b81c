"""Geodetic observations in another convention than declared: mirrored, of opposite sign, in gon, elevations, in feet.

    e = computed at the start - observed,    of directions less the mean over their set

Each kind is held against the start with its values as they are and as they would be in other conventions. Where another
one fits many times better the kind is named, with what its values look like; nothing is changed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float, Text
from aatri.notes import Note
from aatri.observations.geodetic import directions, distances, height_differences, zenith_angles
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput, start_of

FEWEST = 4
BETTER = 5.0
"""Ratio of the median differences from which on another convention is told."""
POOR = 20.0
"""Medians below so many standard deviations are no reason to look."""

Other = Callable[[Float], Float]
GON: dict[str, Other] = {"gon, read as degrees": lambda v: 0.9 * v, "degrees, read as gon": lambda v: v / 0.9}
OTHERS: dict[str, dict[str, Other]] = {
    directions.DIRECTION: {"counted counter-clockwise": lambda v: -v, **GON},
    directions.AZIMUTH: {
        "counted counter-clockwise": lambda v: -v, "counted from south": lambda v: v + np.pi,
        "counted from east, counter-clockwise": lambda v: np.pi / 2 - v, **GON,
    },
    directions.ANGLE: {"counted counter-clockwise": lambda v: -v, **GON},
    zenith_angles.KIND: {"elevations": lambda v: np.pi / 2 - v, **GON},
    height_differences.KIND: {"of opposite sign": lambda v: -v, "in feet": lambda v: 0.3048 * v},
    distances.KIND: {"in feet": lambda v: 0.3048 * v},
    distances.HORIZONTAL: {"in feet": lambda v: 0.3048 * v},
}  # fmt: skip
"""By kind: what its values may be instead, and their change."""


def convention_notes(given: BundleInput) -> list[Note]:
    """Warnings of kinds of geodetic observations that fit the start far better in another convention."""
    if given.given is None:
        return []
    state, table, notes = start_of(given), given.given.block.geodetic, list[Note]()
    for o in given.observed:
        if o.kind not in OTHERS or len(o) < FEWEST or o.records.rows != 1:
            continue
        with np.errstate(invalid="ignore", divide="ignore"):
            v = o.records.residuals(state)[:, 0]
        value = table.value[o.row]
        sets = table.set[o.row] if o.kind == directions.DIRECTION else np.array([])
        known = np.isfinite(v)
        if known.sum() < FEWEST:
            continue
        notes += _of_kind(o, (v + value)[known], value[known], sets[known] if len(sets) else sets)
    return notes


def _of_kind(o: Observed, computed: Float, value: Float, sets: Text) -> list[Note]:
    angular = o.unit == "rad"
    size = {"": _median(computed - value, angular, sets)}
    size |= {name: _median(computed - change(value), angular, sets) for name, change in OTHERS[o.kind].items()}
    best = min(size, key=lambda name: size[name])
    sigma = float(np.nanmedian(o.sigmas()))
    if not best or size[""] < BETTER * size[best] or size[""] < POOR * sigma:
        return []
    text = (
        f"{o.kind}: the {len(value)} values look like {'values ' if best[0] in 'cio' else ''}{best}: so they are "
        f"{size[best]:.2g} {o.unit} from the start in the median, as declared {size['']:.2g} {o.unit}"
    )
    return [Note("warning", text)]


def _median(e: Float, angular: bool, sets: Text) -> float:
    """Median size of differences; of directions less the mean over their set."""
    if not angular:
        return float(np.median(np.abs(e)))
    turn = np.exp(1j * e)
    if len(sets):
        _, of = np.unique(sets, return_inverse=True)
        mean = np.bincount(of, turn.real) + 1j * np.bincount(of, turn.imag)
        turn = turn * np.conj(mean[of])
    return float(np.median(np.abs(np.angle(turn))))
