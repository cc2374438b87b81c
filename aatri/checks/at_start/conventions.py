"""Geodetic observations in another convention than declared: mirrored, of opposite sign, in gon, elevations, in feet.

    e = computed at the start - observed,    of directions less the mean over their set

Seen: residuals of a whole kind that are all off, a network turned over or mirrored.
Test: each kind is held against the start with its values as they are and as they would be in other conventions; where
another one fits five times better, and the values as declared are 20 sigma off, the kind is named. Nothing is changed.
"""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float, Text
from aatri.artifacts.block_control import Geodetic
from aatri.checks.finding import Finding
from aatri.checks.limits import BETTER_CONVENTION, FEWEST_OF_CONVENTION, POOR_CONVENTION_SIGMAS
from aatri.observations.geodetic import differences, directions, distances, zenith_angles
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput, start_of
from aatri.units import FOOT_M

Other = Callable[[Float], Float]
GON: dict[str, Other] = {"gon, read as degrees": lambda v: 0.9 * v, "degrees, read as gon": lambda v: v / 0.9}
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
    distances.KIND: {"in feet": lambda v: FOOT_M * v},
    distances.HORIZONTAL: {"in feet": lambda v: FOOT_M * v},
}
"""By kind: what its values may be instead, and their change."""


def other_conventions(table: Geodetic, inputs: BundleInput) -> list[Finding]:
    """Warnings of kinds of geodetic observations that fit the start far better in another convention."""
    if not len(table):
        return []
    state, findings = start_of(inputs), list[Finding]()
    for o in inputs.observed:
        if o.kind not in OTHERS or len(o) < FEWEST_OF_CONVENTION or o.records.rows != 1:
            continue
        with np.errstate(invalid="ignore", divide="ignore"):
            v = o.records.residuals(state)[:, 0]
        value = table.value[o.row]
        sets = table.set[o.row] if o.kind == directions.DIRECTION else np.array([])
        observed = np.isfinite(v)
        if observed.sum() < FEWEST_OF_CONVENTION:
            continue
        findings += _of_kind(o, (v + value)[observed], value[observed], sets[observed] if len(sets) else sets)
    return findings


def _of_kind(o: Observed, computed: Float, value: Float, sets: Text) -> list[Finding]:
    angular = o.unit == "rad"
    size = {"": _median(computed - value, angular, sets)}
    size |= {name: _median(computed - change(value), angular, sets) for name, change in OTHERS[o.kind].items()}
    best = min(size, key=lambda name: size[name])
    sigma = float(np.nanmedian(o.sigmas()))
    if not best or size[""] < BETTER_CONVENTION * size[best] or size[""] < POOR_CONVENTION_SIGMAS * sigma:
        return []
    text = f"the {len(value)} values look like {'values ' if best[0] in 'cio' else ''}{best}: so they are "
    text += f"{size[best]:.2g} {o.unit} from the start in the median, as declared {size['']:.2g} {o.unit}"
    remedy = "declare them so, or convert them"
    return [Finding("conventions", "warning", text, remedy, where=o.kind, statistic=size[""] / max(size[best], 1e-300))]


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
