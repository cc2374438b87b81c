"""Whether the standard deviations of control, positions, distances ... fit their residuals, each kind by itself.

    s^2 = sum v'P v / sum (1 - tr(L B C B'L'))

with B the Jacobian of a record, C the covariance of the unknowns it touches, L its whitener: the
sum below is the redundancy of the group. A few records hardly move sigma0 of the block, so standard deviations that are
wrong by a unit pass its test: those of control in mm taken as m, positions that claim too much.

Seen: standard deviations in another unit, or claimed too good; sigma0 of the block hardly moves.
Test: chi-square of s^2 at 1e-3 over the number of kinds, of those that are wrong by a factor of two or more: smaller
ones are left to variance components.

Source: Foerstner 1979 (redundancy numbers of groups); Kraus, Photogrammetry, weights of groups of observations.
"""

import numpy as np
from scipy.special import chdtr, chdtrc

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.global_test import GlobalTest, global_test
from aatri.checks.finding import Finding
from aatri.checks.limits import COMPUTED, LEAST_KIND_REDUNDANCY, SIGMAS_FACTOR, SIGMAS_LEVEL
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.result import BundleResult


def sigmas_that_do_not_fit(result: BundleResult) -> list[Finding]:
    """A warning for each kind whose standard deviations are wrong by a large factor.

    Parameters
    ----------
    result : BundleResult
        Without covariances nothing is said.
    """
    if result.adjusted.down_weighted:
        return []
    tests = [(adjusted, test) for adjusted in result.observations if (test := _test(adjusted, result)) is not None]
    findings = []
    for adjusted, test in tests:
        squares = test.redundancy * test.sigma0**2
        chance = 2 * float(min(chdtr(test.redundancy, squares), chdtrc(test.redundancy, squares)))
        factor = max(test.sigma0, 1 / max(test.sigma0, 1e-300))
        if chance >= SIGMAS_LEVEL / len(tests) or factor < SIGMAS_FACTOR:
            continue
        text, remedy = _sentence(len(adjusted.rows), test, factor)
        kind, rows = adjusted.observed.kind, {adjusted.observed.kind: adjusted.observed.row}
        findings.append(
            Finding("sigmas", "warning", text, remedy, where=kind, statistic=squares, significance=chance, rows=rows)
        )
    return findings


def _sentence(count: int, test: GlobalTest, factor: float) -> tuple[str, str]:
    """What is said of so many observations of a kind, and what to do."""
    if test.sigma0 < COMPUTED:
        text = f"residuals of these {count} observations are 0 (redundancy {test.redundancy})"
        return text, "were they computed from coordinates, not measured?"
    text = f"sigma0 of these {count} observations alone is {test.sigma0:.3g} (redundancy {test.redundancy}): their "
    if test.sigma0 < 1:
        return f"{text}standard deviations are about {factor:.2g} times too large", "is it a unit?"
    text += f"standard deviations are about {factor:.2g} times too small"
    return text, "correct them, or look for gross errors in them"


def _test(adjusted: AdjustedObservations, result: BundleResult) -> GlobalTest | None:
    """sigma0 of a kind; None where its redundancy is small or not known, and of rays: sigma0 tells of them."""
    o = adjusted.observed
    if not o.is_measured or {POSE, POINT} <= o.records.groups:
        return None
    rows = np.flatnonzero(adjusted.used)
    rows = rows[np.isfinite(adjusted.covariance[rows]).all(axis=(1, 2))]
    if not len(rows):
        return None
    v = whitened_residuals(o.records, result.adjusted.state, rows)
    count = int(o.records.observed_components()[rows].sum())
    redundancy = count - float(np.einsum("nii->", adjusted.covariance[rows]))
    if redundancy < LEAST_KIND_REDUNDANCY:
        return None
    return global_test(float(np.sqrt((v**2).sum() / redundancy)), round(redundancy))
