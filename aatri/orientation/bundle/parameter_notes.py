"""What an adjusted block says of its camera parameters: significance, data share, correlations with their reasons.

Sets of additional parameters are tested against zero, a-posteriori sigma0 and its redundancy applied; parameters of
camera models only where they describe the lens. Correlations are looked for within a unit (a camera, a session, an
image), and with the orientation of the image that has the most points of the unit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.statistics.removal import Removal, stepwise_removal
from aatri.adjustment.statistics.significance import (
    UNDETERMINED_SHARE,
    Estimates,
    correlated_pairs,
    correlated_with_others,
    estimates,
    joint_test,
    parameter_tests,
)
from aatri.camera.models import calibration
from aatri.camera.parameters.advice import WARNED, advise, kinds_of_columns
from aatri.ids import shown
from aatri.notes import Note
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import CAMERA, POSE, is_additional
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

CHANGED = 1e-3
"""Probability below which a difference to a calibration is told as a warning."""

MOVED = 10.0
"""A parameter that moves by more than this times its own standard deviation a priori is another one's."""

MOST_UNITS = 4
"""More units than this are summed up in one line."""

CHOSEN = (
    "standard deviations are those of the parameters that are left; the same block has chosen them, which makes them "
    "too small, those of points by some 5 %, of orientations by up to 20 %; `remove: false` keeps them true"
)
"""What is to be said after a choice of parameters; measured, see docs/methods/self_calibration.md."""

MOST_COLUMNS = 2000
"""Image points that tell what a parameter does."""

_SHORT = {"principal_distance": "c", "principal_point.x": "x0", "principal_point.y": "y0"}
_POSE = ("X0", "Y0", "Z0", "omega", "phi", "kappa")


def parameter_notes(given: BundleInput, result: BundleResult) -> list[Note]:
    """Notes of what is not significant, warnings of what is not determined or highly correlated.

    Parameters
    ----------
    given : BundleInput
    result : BundleResult
        With covariances; without there is nothing to say.
    """
    notes: list[Note] = []
    for group in result.parameters:
        if group.given.group != CAMERA and not is_additional(group.given.group):
            continue
        if group.given.calibrated:
            notes += _calibrated(group)
            continue
        found = [(k, e) for k in range(len(group.value)) if (e := unit_estimates(group, k, result)) is not None]
        if len(found) > MOST_UNITS:
            notes += _summed_up(given, group, [e for _, e in found])
            continue
        for k, e in found:
            notes += _unit(given, result, group, k, e)
    return notes


def unit_estimates(group: AdjustedParameters, unit: int, result: BundleResult) -> Estimates | None:
    """Estimates of one unit for tests, weighted ones as their difference to the prior; None without covariance."""
    g = group.given
    columns = np.flatnonzero(g.free[unit])
    covariance = group.covariance[unit][np.ix_(columns, columns)]
    if not len(columns) or not np.isfinite(covariance).all() or not (np.diag(covariance) > 0).all():
        return None
    weighted = g.weighted[unit, columns]
    prior = np.where(weighted, np.sqrt(g.covariance[unit, columns, columns]), np.inf)
    value = group.value[unit, columns] - np.where(weighted, g.prior[unit, columns], 0.0)
    names = [parameter_names(g, unit)[j] for j in columns]
    redundancy = result.adjusted.redundancy
    sigma0 = result.adjusted.sigma0 if redundancy > 0 else 1.0
    return estimates(names, value, covariance, prior, sigma0=sigma0, redundancy=redundancy if redundancy else np.inf)


def parameter_names(rows: ParameterRows, unit: int) -> tuple[str, ...]:
    """Names of a unit's parameters as advice knows them: c, x0, y0, k1 ..."""
    names = calibration.PARAMETERS[rows.model[unit]] if rows.group == CAMERA else rows.labels
    return tuple(_SHORT.get(name, name) for name in names)


def column_kinds(given: BundleInput) -> dict[str, str]:
    """What the additional parameters do, by their columns at the image points."""
    found: dict[str, str] = {}
    for rows in given.parameters:
        if is_additional(rows.group) and rows.basis is not None and given.rays is not None:
            known = np.flatnonzero(np.isfinite(given.rays.xy_mm).all(axis=1))[:MOST_COLUMNS]
            found |= kinds_of_columns(rows.labels, rows.basis[known], given.rays.xy_mm[known])
    return found


def without_idle(given: BundleInput, result: BundleResult) -> tuple[tuple[ParameterRows, ...] | None, list[Note]]:
    """The parameters with those held at zero that are not worth keeping; None if all are.

    Parameters
    ----------
    given : BundleInput
    result : BundleResult

    Returns
    -------
    tuple of ParameterRows or None
    list of Note
        What is left out, and why.
    """
    groups, notes = list(given.parameters), list[Note]()
    for i, group in enumerate(result.parameters):
        if not is_additional(group.given.group):
            continue
        free = group.given.free.copy()
        for k in range(len(free)):
            e = unit_estimates(group, k, result)
            removals = stepwise_removal(e)[1] if e is not None else ()
            for removal in removals:
                free[k, parameter_names(group.given, k).index(removal.name)] = False
            notes += _removals(str(group.given.ids[k]), removals)
        groups[i] = replace(given.parameters[i], free=free)
    if notes:
        notes.append(Note("warning", CHOSEN))
    return (tuple(groups) if notes else None), notes


def _removals(unit: str, removals: tuple[Removal, ...]) -> list[Note]:
    return [Note("note", f"{unit}: {removal.name} left out, {removal.reason}") for removal in removals]


def _calibrated(group: AdjustedParameters) -> list[Note]:
    """Whether parameters agree with the calibration that weights them: their difference has covariance P - C."""
    g, notes = group.given, []
    for k, name in enumerate(g.ids):
        columns = np.flatnonzero(g.free[k])
        prior = g.covariance[k][np.ix_(columns, columns)]
        spread = prior - group.covariance[k][np.ix_(columns, columns)]
        if not np.isfinite(spread).all():
            continue
        told = np.flatnonzero(np.diag(spread) > 1e-6 * np.diag(prior))  # less is rounding: the block adds nothing
        columns, prior, spread = columns[told], prior[np.ix_(told, told)], spread[np.ix_(told, told)]
        scale = np.sqrt(np.diag(prior))
        difference = (group.value[k] - g.prior[k])[columns] / scale
        test = joint_test(estimates([g.labels[c] for c in columns], difference, spread / np.outer(scale, scale)))
        text = f"{name}: difference to the calibration, chi-square over {test.parameters}: {test.statistic:.2f}"
        if test.p_value < CHANGED:
            why = "the camera has changed since, or the calibration has other corrections before it"
            notes.append(Note("warning", f"{text}: {why}"))
        else:
            notes.append(Note("note", text))
    return notes


def _unit(given: BundleInput, result: BundleResult, group: AdjustedParameters, unit: int, e: Estimates) -> list[Note]:
    name, tests, notes = str(group.given.ids[unit]), parameter_tests(e), []
    lens = np.array([n not in _SHORT.values() for n in e.names]) | is_additional(group.given.group)
    prior = tests.data_share < UNDETERMINED_SHARE
    if prior.any():
        which = ", ".join(f"{e.names[i]} ({tests.data_share[i]:.0%})" for i in np.flatnonzero(prior))
        text = f"{name}: the data do not determine, share of the data in the value: {which}"
        notes.append(Note("warning", text))
    idle = np.flatnonzero(lens & ~prior & ~tests.significant)
    if len(idle):
        which = ", ".join(f"{e.names[i]} (|t| {abs(tests.t[i]):.1f})" for i in idle)
        notes.append(Note("note", f"{name}: not significant at 5 %: {which}"))
    notes += _moved(group, unit)
    pairs = [(p.first, p.second, p.correlation) for p in correlated_pairs(e, WARNED)]
    kinds = column_kinds(given) if is_additional(group.given.group) else {}
    advice = advise([*pairs, *_pairs_with_pose(given, result, group, unit, e)], kinds)
    return [*notes, *(Note("warning", f"{name}: {a.text}") for a in advice)]


def _moved(group: AdjustedParameters, unit: int) -> list[Note]:
    """Weighted parameters far from their given values: the calibration is of another camera, or older than a change."""
    g = group.given
    columns = np.flatnonzero(g.free[unit] & g.weighted[unit])
    sigma = np.sqrt(np.diag(g.covariance[unit])[columns])
    change = group.value[unit, columns] - g.prior[unit, columns]
    names, far = parameter_names(g, unit), np.flatnonzero(np.abs(change) > MOVED * sigma)
    told = [f"{names[columns[k]]} by {change[k]:.3g} ({abs(change[k]) / sigma[k]:.0f} of its sigmas)" for k in far]
    if not told:
        return []
    why = "is it calibrated with this lens, focus and film?"
    return [Note("warning", f"{g.ids[unit]}: parameters leave their given values: {', '.join(told)}; {why}")]


def _pairs_with_pose(
    given: BundleInput, result: BundleResult, group: AdjustedParameters, unit: int, e: Estimates
) -> list[tuple[str, str, float]]:
    """High correlations with the orientation of the image that has the most points of the unit.

    None in a free datum: the factor has scalars held there, the variances of the orientations are of inner constraints.
    """
    if group.given.per_image or given.rays is None or result.free is not None:
        return []
    images = given.rays.image[(group.given.block == unit) & result.ray_used]
    if not len(images):
        return []
    image = int(np.bincount(images).argmax())
    cross = covariances_of_pairs(result.adjusted, [((group.given.group, unit), (POSE, image))])[0]
    labels = [f"{n} of image {given.image_ids[image]}" for n in _POSE]
    variance = np.diag(result.pose_covariance[image])
    columns = np.flatnonzero(group.given.free[unit])
    found = correlated_with_others(e, cross[columns], variance, labels, WARNED)
    return [(p.first, p.second, p.correlation) for p in found]


def _summed_up(given: BundleInput, group: AdjustedParameters, found: list[Estimates]) -> list[Note]:
    """One line each for many units."""
    idle: dict[str, int] = {}
    coupled: dict[tuple[str, str], list[float]] = {}
    for e in found:
        tests = parameter_tests(e)
        for i in np.flatnonzero(~tests.significant):
            idle[e.names[i]] = idle.get(e.names[i], 0) + 1
        for p in correlated_pairs(e, WARNED):
            coupled.setdefault((p.first, p.second), []).append(p.correlation)
    notes, what = [], f"{group.given.group} of {len(found)} units"
    kinds = column_kinds(given) if is_additional(group.given.group) else {}
    if idle:
        names = shown([f"{name} ({n})" for name, n in sorted(idle.items())])
        notes.append(Note("note", f"{what}: not significant in {names}"))
    for (first, second), rho in sorted(coupled.items()):
        for advice in advise([(first, second, max(rho, key=abs))], kinds):
            notes.append(Note("warning", f"{what}: in {len(rho)}, at most: {advice.text}"))
    return notes
