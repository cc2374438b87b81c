"""sigma0 of a whole adjustment, and what finds the standard deviations where it does not fit.

Seen: residuals larger or smaller than the standard deviations allow: gross errors, an effect that is not modelled,
wrong standard deviations.
Test: the global test, chi-square (`adjustment.statistics.global_test`); beyond `max_sigma0` the result is refused, but
for one that contradicts its own tests by a cause with a name.
Points or images that are held, and that an earlier stage has made of these observations, follow them: v'P v is that of
a redundancy smaller by their unknowns. A sigma0 that is too small is so only where it is by that redundancy, too.
"""

import numpy as np

from aatri.adjustment.statistics.global_test import global_test, largest_sigma0, sigma0_note
from aatri.adjustment.statistics.limits import MAX_SIGMA0, limit_of_tests
from aatri.checks.finding import Finding
from aatri.errors import ConvergenceError
from aatri.ids import several
from aatri.orientation.bundle.blunders.tested_block import tests_of
from aatri.orientation.bundle.result import BundleResult

MOST = 5
"""Observations that are named."""

LOOK = "measure them again, or leave `blunders: none` out"
REMEDY = "`variance_components: {groups: [kind]}` estimates those of each kind of observation"
REFUSED = (
    "check ids, units, camera, start values and control; look for gross errors with a robust method first; standard "
    "deviations that are too small by this factor are to be corrected in the block"
)


def sigma0(
    result: BundleResult,
    max_sigma0: float | None,
    scale: float = 1.0,
    cause: Finding | None = None,
    *,
    with_cause: float = np.inf,
    held_unknowns: int = 0,
    searched: bool = True,
    sigma_rad: float = 0.0,
) -> list[Finding]:
    """sigma0 with its interval; an error where it is beyond `max_sigma0`.

    Parameters
    ----------
    max_sigma0 : float, optional
        Default: `MAX_SIGMA0`, and only where no `cause` explains it; with standard deviations that fit (`scale`) more,
        as long as those of rays are no larger than anybody measures (`largest_sigma0`).
    with_cause : float
        sigma0 of the adjustment that has carried the `cause`; with more than `MAX_SIGMA0` it explains nothing.
    scale : float
        Of the standard deviations in use over those given, of most observations: `max_sigma0` is for those given.
    cause : Finding, optional
        A group that the result contradicts: it says what to do before anything else.
    held_unknowns : int
        Unknowns that are held at values which may be made of the observations.
    searched : bool
        Whether gross errors were looked for; else the largest misfits are named.
    sigma_rad : float
        Of the rays as stated; 0: there are none.
    """
    if result.adjusted.down_weighted:
        return []
    counted = result.adjusted.redundancy if result.counted is None else round(result.counted)
    test = global_test(result.adjusted.sigma0, counted)
    limit = MAX_SIGMA0 if max_sigma0 is None else max_sigma0
    if max_sigma0 is None and test.sigma0 <= limit:
        limit = largest_sigma0(sigma_rad)
    explained = max_sigma0 is None and with_cause * scale <= limit
    if test.verdict != "untested" and test.sigma0 * scale > limit and not explained:
        text = f"sigma0 is {test.sigma0 * scale:.3g}, beyond max_sigma0 = {limit:g}: the adjustment ended where the "
        return [
            Finding(
                "sigma0",
                "error",
                f"{text}observations do not fit it{'' if searched else _standing_out(result)}",
                REFUSED if cause is None else f"{cause.sentence.split(';')[0]}: {cause.remedy}",
                statistic=test.sigma0 * scale,
                error=ConvergenceError,
            )
        ]
    if 0 < held_unknowns < counted and test.sigma0 < test.low:
        follow = global_test(test.sigma0 * (counted / (counted - held_unknowns)) ** 0.5, counted - held_unknowns)
        if follow.sigma0 >= follow.low:
            text = (
                f"sigma0 {test.sigma0:.3f} (redundancy {counted}); as the {several(held_unknowns, 'unknown')} "
                f"held follow the observations that made them, {follow.sigma0:.3f} (redundancy {follow.redundancy})"
            )
            return [Finding("sigma0", "note", text, statistic=follow.sigma0)]
    note = sigma0_note(test, "" if scale == 1.0 else "with standard deviations that fit")
    remedy = REMEDY if note.level == "warning" else ""
    of_all = Finding("sigma0", note.level, note.text, remedy, statistic=test.sigma0)
    largest = "" if searched else _standing_out(result)
    text = f"no gross errors were looked for (`blunders: none`){largest}"
    return [of_all, Finding("sigma0", "warning", text, LOOK)] if largest else [of_all]


def _standing_out(result: BundleResult) -> str:
    """The observations in use whose tests stand out of the others, the largest first; empty where none do."""
    state, sigma0 = result.adjusted.state, max(1.0, result.adjusted.sigma0)
    limit = limit_of_tests(result.adjusted.observations) * sigma0
    out: list[tuple[float, int, int]] = []
    for number, o in enumerate(result.observations):
        w = np.where(o.used, tests_of(o, state), np.nan)
        out += [(float(w[row]), number, row) for row in np.flatnonzero(w > limit).tolist()]
    if not out:
        return ""
    largest = [(w, result.observations[number].observed, row) for w, number, row in sorted(out, reverse=True)[:MOST]]
    return "; largest tests: " + ", ".join(f"{o.kind} {o.label(row)} {w:.3g} sigma" for w, o, row in largest)
