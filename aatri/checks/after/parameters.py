"""What an adjusted block says of its camera parameters: significance, data share, correlations with their reasons.

Seen: parameters that the data do not determine, that mean nothing, that stand for each other, or of another camera.
Test: t of each parameter at 5 %, a-posteriori sigma0 and its redundancy applied; parameters of camera models only where
they describe the lens; chi-square of the difference to a calibration at 0.1 %; a value given with a standard deviation
that moves by more than ten of them; a c below 0, an aspect below -1; correlations of 0.95 and more. Correlations are
looked for within a unit (a camera, a session, an image), and with the orientation of the image that has the most points
of the unit.
"""

import numpy as np

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.statistics.limits import UNDETERMINED_SHARE
from aatri.adjustment.statistics.significance import (
    CorrelatedPair,
    Estimates,
    correlated_pairs,
    correlated_with_others,
    estimates,
    joint_test,
    parameter_tests,
)
from aatri.camera.limits import WARNED_CORRELATION
from aatri.camera.parameters.advice import SHORT, advise
from aatri.checks.finding import Finding
from aatri.checks.limits import CALIBRATION_CHANGED, MOST_UNITS_TOLD, MOVED_SIGMAS
from aatri.ids import shown
from aatri.observations.poses import CAMERA, POSE, is_additional
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.parameter_estimates import column_kinds, parameter_names, unit_estimates
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

_POSE = ("X0", "Y0", "Z0", "omega", "phi", "kappa")


def parameter_findings(inputs: BundleInput, result: BundleResult) -> list[Finding]:
    """Notes of what is not significant, warnings of what is not determined or highly correlated.

    Parameters
    ----------
    result : BundleResult
        With covariances; without there is nothing to say.
    """
    findings: list[Finding] = []
    for group in result.parameters:
        if group.given.group != CAMERA and not is_additional(group.given.group):
            continue
        if group.given.calibrated:
            findings += _calibrated(group)
            continue
        estimated = [(k, e) for k in range(len(group.value)) if (e := unit_estimates(group, k, result)) is not None]
        if len(estimated) > MOST_UNITS_TOLD:
            findings += _summed_up(inputs, group, [e for _, e in estimated])
            continue
        for k, e in estimated:
            findings += _unit(inputs, result, group, k, e)
    return findings


def moved_cameras(result: BundleResult) -> set[str]:
    """Cameras, or sessions and images with parameters of their own, that have left their given values."""
    cameras = [g for g in result.parameters if g.given.group == CAMERA and not g.given.calibrated]
    return {str(g.given.ids[k]) for g in cameras for k in range(len(g.value)) if _moved(g, k)}


def _calibrated(group: AdjustedParameters) -> list[Finding]:
    """Whether parameters agree with the calibration that weights them: their difference has covariance P - C."""
    g, findings = group.given, []
    for k, name in enumerate(g.ids):
        columns = np.flatnonzero(g.free[k])
        prior = g.covariance[k][np.ix_(columns, columns)]
        spread = prior - group.covariance[k][np.ix_(columns, columns)]
        if not np.isfinite(spread).all():
            continue
        determined = np.flatnonzero(np.diag(spread) > 1e-6 * np.diag(prior))  # less is rounding: the block adds nothing
        both = np.ix_(determined, determined)
        columns, prior, spread = columns[determined], prior[both], spread[both]
        scale = np.sqrt(np.diag(prior))
        difference = (group.value[k] - g.prior[k])[columns] / scale
        test = joint_test(estimates([g.labels[c] for c in columns], difference, spread / np.outer(scale, scale)))
        text = f"{name}: difference to the calibration, chi-square over {test.parameters}: {test.statistic:.2f}"
        if test.p_value < CALIBRATION_CHANGED:
            reason = "has the camera changed since, or has the calibration other corrections before it?"
            findings.append(
                Finding("parameters", "warning", text, reason, statistic=test.statistic, significance=test.p_value)
            )
        else:
            findings.append(Finding("parameters", "note", text))
    return findings


def _unit(
    inputs: BundleInput, result: BundleResult, group: AdjustedParameters, unit: int, e: Estimates
) -> list[Finding]:
    name, tests, findings = f"parameters of {group.given.ids[unit]}", parameter_tests(e), []
    lens = np.array([n not in SHORT.values() for n in e.names]) | is_additional(group.given.group)
    prior = tests.data_share < UNDETERMINED_SHARE
    if prior.any():
        which = ", ".join(f"{e.names[i]} ({tests.data_share[i]:.0%})" for i in np.flatnonzero(prior))
        text = f"{name} that the observations hardly determine, with their share in the value: {which}"
        findings.append(Finding("parameters", "warning", text))
    idle = np.flatnonzero(lens & ~prior & ~tests.significant)
    if len(idle):
        which = ", ".join(f"{e.names[i]} (|t| {abs(tests.t[i]):.1f})" for i in idle)
        findings.append(Finding("parameters", "note", f"{name}: not significant at 5 %: {which}"))
    findings += [*_moved(group, unit), *_mirrored(group, unit)]
    kinds = column_kinds(inputs) if is_additional(group.given.group) else {}
    advice = advise(
        [*correlated_pairs(e, WARNED_CORRELATION), *_pairs_with_pose(inputs, result, group, unit, e)], kinds
    )
    return [*findings, *(Finding("parameters", "warning", f"{name}: {a.text}") for a in advice)]


def _moved(group: AdjustedParameters, unit: int) -> list[Finding]:
    """Weighted parameters far from their given values: the calibration is of another camera, or older than a change."""
    g = group.given
    columns = np.flatnonzero(g.free[unit] & g.weighted[unit])
    sigma = np.sqrt(np.diag(g.covariance[unit])[columns])
    change = group.value[unit, columns] - g.prior[unit, columns]
    names, far = parameter_names(g, unit), np.flatnonzero(np.abs(change) > MOVED_SIGMAS * sigma)
    moved = [f"{names[columns[k]]} by {change[k]:.3g} ({abs(change[k]) / sigma[k]:.0f} of its sigmas)" for k in far]
    if not moved:
        return []
    reason = "is it calibrated with this lens, focus and film?"
    text = f"parameters leave their given values: {', '.join(moved)}"
    return [Finding("parameters", "warning", text, reason, where=str(g.ids[unit]))]


def _mirrored(group: AdjustedParameters, unit: int) -> list[Finding]:
    """A free camera that has taken up mirrored images, which fit flat ground with a negative c or aspect."""
    least = {"c": 0.0, "as": -1.0}
    values = zip(parameter_names(group.given, unit), group.value[unit].tolist())
    mirrored = [f"{name} {value:.5g}" for name, value in values if value < least.get(name, -np.inf)]
    if not mirrored or group.given.group != CAMERA:
        return []
    text, remedy = (
        f"its images are mirrored: {', '.join(mirrored)}",
        "check the y axis of its image coordinates (pixel: y)",
    )
    return [Finding("parameters", "warning", text, remedy, where=f"camera {group.given.ids[unit]}")]


def _pairs_with_pose(
    inputs: BundleInput, result: BundleResult, group: AdjustedParameters, unit: int, e: Estimates
) -> list[CorrelatedPair]:
    """High correlations with the orientation of the image that has the most points of the unit.

    None in a free datum: the factor has scalars held there, the variances of the orientations are of inner constraints.
    """
    if group.given.per_image or inputs.rays is None or result.free is not None:
        return []
    images = inputs.rays.image[(group.given.block == unit) & result.ray_used]
    if not len(images):
        return []
    image = int(np.bincount(images).argmax())
    cross = covariances_of_pairs(result.adjusted, [((group.given.group, unit), (POSE, image))])[0]
    labels = [f"{n} of image {inputs.image_ids[image]}" for n in _POSE]
    variance = np.diag(result.pose_covariance[image])
    columns = np.flatnonzero(group.given.free[unit])
    return correlated_with_others(e, cross[columns], variance, labels, WARNED_CORRELATION)


def _summed_up(inputs: BundleInput, group: AdjustedParameters, estimated: list[Estimates]) -> list[Finding]:
    """One line each for many units."""
    idle: dict[str, int] = {}
    coupled: dict[tuple[str, str], list[float]] = {}
    for e in estimated:
        tests = parameter_tests(e)
        for i in np.flatnonzero(~tests.significant):
            idle[e.names[i]] = idle.get(e.names[i], 0) + 1
        for p in correlated_pairs(e, WARNED_CORRELATION):
            coupled.setdefault((p.first, p.second), []).append(p.correlation)
    findings, what = [], f"{group.given.group} of {len(estimated)} units"
    kinds = column_kinds(inputs) if is_additional(group.given.group) else {}
    if idle:
        names = shown([f"{name} ({n})" for name, n in sorted(idle.items())])
        findings.append(Finding("parameters", "note", f"{what}: not significant in {names}"))
    for (first, second), rho in sorted(coupled.items()):
        for advice in advise([(first, second, max(rho, key=abs))], kinds):
            findings.append(Finding("parameters", "warning", f"{what}: in {len(rho)}, at most: {advice.text}"))
    return findings
