"""Whether the standard deviations of control, positions, distances ... fit their residuals, each kind by itself.

    s^2 = sum v'P v / sum (1 - tr(L B C B'L'))

with B the Jacobian of a record, C the covariance of the unknowns it touches, L its whitener: the
sum below is the redundancy of the group. A few records hardly move sigma0 of the block, so standard deviations that are
wrong by a unit pass its test: those of control in mm taken as m, positions that claim too much.

Seen: standard deviations in another unit, or claimed too good; sigma0 of the block hardly moves.
Test: chi-square of s^2 at 1e-3 over the number of kinds, of those that are wrong by a factor of two or more: smaller
ones are left to variance components. Control and positions `FAR_MORE_EXACT` times as exact as an image point is on the
ground have no redundancy to test: image points cannot tell an error of theirs below their own.

Source: Foerstner 1979 (redundancy numbers of groups); Kraus, Photogrammetry, weights of groups of observations.
"""

import numpy as np
from scipy.special import chdtr, chdtrc

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.global_test import GlobalTest, global_test
from aatri.arrays import Float
from aatri.checks.finding import Finding
from aatri.checks.limits import COMPUTED, FAR_MORE_EXACT, LEAST_KIND_REDUNDANCY, SIGMAS_FACTOR, SIGMAS_LEVEL
from aatri.observations.control import KIND as CONTROL
from aatri.observations.observed import NEARLY_EXACT
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.seen_distances import on_ground_m
from aatri.units import about

UNIT = "check `units.sigma_ground` and the standard deviations; 0 is exact"


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


def more_exact_than_images(inputs: BundleInput, result: BundleResult, scale: float = 1.0) -> list[Finding]:
    """A warning for control and positions so exact that image points check nothing of it.

    Parameters
    ----------
    scale : float
        Of the standard deviations of image points in use over those given.
    """
    on_ground, findings = scale * on_ground_m(inputs.rays, inputs.poses, inputs.xyz_m), list[Finding]()
    for kind in (CONTROL, POSITION):
        sigma_m = np.concatenate(
            [np.zeros(0), *(_inexact_m(o) for o in result.observations if o.observed.kind == kind)]
        )
        typical = float(np.median(sigma_m)) if len(sigma_m) else np.inf
        if on_ground > FAR_MORE_EXACT * typical:
            ratio = on_ground / typical
            text = f"standard deviations of {about(typical)} are {ratio:.0f} times smaller than an image point on the "
            text += f"ground ({about(on_ground)}): no test sees errors below that, and the result's standard "
            text += "deviations do not contain them"
            findings.append(Finding("sigmas", "warning", text, UNIT, where=kind, statistic=ratio))
    return findings


def _inexact_m(adjusted: AdjustedObservations) -> Float:
    """Standard deviations of the coordinates in use, (k,), m; without exact ones, which have `NEARLY_EXACT` or none."""
    a_priori = adjusted.observed.records.sigmas()
    inexact = np.isfinite(a_priori) & ~np.isclose(a_priori, NEARLY_EXACT, rtol=1e-6, atol=0.0)
    return np.asarray(adjusted.records.sigmas()[inexact & adjusted.used[:, None]])


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
