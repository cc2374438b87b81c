"""Adjusted parameters of cameras, unit by unit, as estimates for tests; those not worth keeping.

Sets of additional parameters are tested against zero, a-posteriori sigma0 and its redundancy applied.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.removal import Removal, stepwise_removal
from aatri.adjustment.statistics.significance import Estimates, estimates
from aatri.camera.models import calibration
from aatri.camera.parameters.advice import kinds_of_columns
from aatri.notes import Note
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import CAMERA, is_additional
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

CHOSEN = (
    "standard deviations are those of the parameters that are left; the same block has chosen them, which makes them "
    "too small, those of points by some 5 %, of orientations by up to 20 %; `remove: false` keeps them true"
)
"""What is to be said after a choice of parameters; measured, see docs/methods/self_calibration.md."""

MOST_COLUMNS = 2000
"""Image points that tell what a parameter does."""

SHORT = {"principal_distance": "c", "principal_point.x": "x0", "principal_point.y": "y0"}
"""Names of camera models as advice knows them."""


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
    return tuple(SHORT.get(name, name) for name in names)


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
