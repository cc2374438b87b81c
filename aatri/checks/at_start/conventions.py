"""Geodetic observations in another convention than declared: mirrored, of opposite sign, in gon, elevations, in feet;
or lengths, as of portable frames, in another unit than the coordinates.

    e = computed at the start - observed,    of directions less the mean over their set

Seen: residuals of a whole kind that are all off, a network turned over or mirrored.
Test: each kind is held against the start with its values as they are and as they would be in other conventions; where
another one fits five times better, and the values as declared are 20 sigma off, the kind is named; where it fits
`CERTAIN_CONVENTION` times better the bundle does not begin, as it would reject good image points for them. Sets with
covariances, as of portable frames, each have a unit of their own. Single azimuths are 180 degrees off, to 1, where from
and to are exchanged; a gross error of any size is so in one of 180 cases.
"""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.block_tables import Geodetic
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import (
    BETTER_CONVENTION,
    CERTAIN_CONVENTION,
    FEWEST_OF_CONVENTION,
    POOR_CONVENTION_SIGMAS,
    REVERSED_RAD,
)
from aatri.observations.geodetic import differences, directions, distances, zenith_angles
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput, start_of
from aatri.units import FOOT_M

Other = Callable[[Float], Float]
GON: dict[str, Other] = {"gon, read as degrees": lambda v: 0.9 * v, "degrees, read as gon": lambda v: v / 0.9}
OF_COORDINATES = "beside coordinates"
LENGTHS: dict[str, Other] = {
    "in mm": lambda v: 1e-3 * v,
    "in cm": lambda v: 1e-2 * v,
    "in feet": lambda v: FOOT_M * v,
    f"in m, {OF_COORDINATES} in mm": lambda v: 1e3 * v,
    f"in m, {OF_COORDINATES} in cm": lambda v: 1e2 * v,
    f"in m, {OF_COORDINATES} in feet": lambda v: v / FOOT_M,
}
OTHERS: dict[str, dict[str, Other]] = {
    directions.DIRECTION: {"counted counter-clockwise": lambda v: -v, **GON},
    directions.AZIMUTH: {
        "counted counter-clockwise": lambda v: -v,
        "counted from south": lambda v: v + np.pi,
        "counted from east, counter-clockwise": lambda v: np.pi / 2 - v,
        **GON,
    },
    directions.ANGLE: {"counted counter-clockwise": lambda v: -v, **GON},
    zenith_angles.KIND: {"elevations": lambda v: np.pi / 2 - v, **GON},
    differences.HEIGHT_DIFFERENCE: {"of opposite sign": lambda v: -v, "in feet": lambda v: FOOT_M * v},
    distances.KIND: LENGTHS,
    distances.HORIZONTAL: LENGTHS,
}
"""By kind: what its values may be instead, and their change."""


def other_conventions(block: Block, inputs: BundleInput) -> list[Finding]:
    """Kinds of geodetic observations, and portable frames, that fit the start far better in another convention."""
    table = block.geodetic
    if not len(table):
        return []
    state, findings = start_of(inputs), list[Finding]()
    for o in inputs.observed:
        rows = o.row[:, None] if o.set_rows is None else o.set_rows
        if o.kind not in OTHERS or rows.shape[1] != o.records.rows:
            continue
        with np.errstate(invalid="ignore", divide="ignore"):
            v = o.records.residuals(state)
        apart = [slice(None)] if o.set_rows is None else [slice(k, k + 1) for k in range(len(o))]
        for unit in apart:  # a kind, or each set with covariances
            observed = np.isfinite(v[unit])
            if observed.sum() >= FEWEST_OF_CONVENTION:
                of_set = o.set_rows is not None
                where = block.read_at(table, int(rows[unit][0, 0])) if of_set else ""
                findings += _of_rows(o, table, v[unit][observed], rows[unit][observed], where)
        if o.kind == directions.AZIMUTH and not any(finding.where == o.kind for finding in findings):
            findings += _reversed(table, v.ravel(), rows.ravel())
    return findings


def _reversed(table: Geodetic, v: Float, rows: Int) -> list[Finding]:
    """Azimuths of which from and to are exchanged."""
    e = np.abs(np.angle(np.exp(1j * np.nan_to_num(v))))
    rows = rows[(np.pi - e < REVERSED_RAD) & (e > POOR_CONVENTION_SIGMAS * table.sigma[rows])]
    if not len(rows):
        return []
    text = f"{len(rows)} of {len(v)} point the other way than the start, to a degree"
    remedy = "exchange from and to, or check the approximate coordinates: a network turns with its azimuths"
    ids = tuple(f"{start} to {end}" for start, end in zip(table.start[rows].tolist(), table.end[rows].tolist()))
    return [Finding("conventions", "warning", text, remedy, ids=ids, where=directions.AZIMUTH)]


def _of_rows(o: Observed, table: Geodetic, v: Float, rows: Int, where: str) -> list[Finding]:
    value, angular = table.value[rows], o.unit == "rad"
    sets, computed = table.set[rows] if o.kind == directions.DIRECTION else np.array([]), v + value
    size = {"": _median(computed - value, angular, sets)}
    size |= {name: _median(computed - change(value), angular, sets) for name, change in OTHERS[o.kind].items()}
    best, sigma = min(size, key=lambda name: size[name]), float(np.nanmedian(table.sigma[rows]))
    if not best or size[""] < BETTER_CONVENTION * size[best] or size[""] < POOR_CONVENTION_SIGMAS * sigma:
        return []
    text = f"the {len(value)} values look like {'values ' if best[0] in 'cio' else ''}{best}: so they are "
    text += f"{size[best]:.2g} {o.unit} from the start in the median, as declared {size['']:.2g} {o.unit}"
    ratio = size[""] / max(size[best], 1e-300)
    level: Level = "error" if ratio > CERTAIN_CONVENTION else "warning"
    where = f"{where}: {o.kind}s of a portable frame or a set" if where else o.kind
    remedy = "convert the coordinates to m" if OF_COORDINATES in best else "declare them so, or convert them"
    return [Finding("conventions", level, text, remedy, where=where, statistic=ratio)]


def _median(e: Float, angular: bool, sets: Text) -> float:
    """Median size of differences; of directions less the mean over their set."""
    if not angular:
        return float(np.median(np.abs(e)))
    turn = np.exp(1j * e)
    if len(sets):
        _, set_row = np.unique(sets, return_inverse=True)
        mean = np.bincount(set_row, turn.real) + 1j * np.bincount(set_row, turn.imag)
        turn = turn * np.conj(mean[set_row])
    return float(np.median(np.abs(np.angle(turn))))
