"""Adjusted parameters of cameras, unit by unit, as estimates for tests; those not worth keeping.

Sets of additional parameters are tested against zero, a-posteriori sigma0 and its redundancy applied.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.statistics.removal import stepwise_removal
from aatri.adjustment.statistics.significance import Estimates, estimates
from aatri.arrays import Bool
from aatri.camera.models import calibration
from aatri.camera.parameters.advice import SHORT, kinds_of_columns
from aatri.notes import Note
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import CAMERA, is_additional
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

COUNTED = (
    "what is left out as not significant counts in the standard deviations of points and orientations, as it may be; "
    "those of the parameters are those of the set that is left"
)

MOST_COLUMNS = 2000
"""Image points that tell what a parameter does."""


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


def column_kinds(inputs: BundleInput) -> dict[str, str]:
    """What the additional parameters do, by their columns at the image points."""
    kinds: dict[str, str] = {}
    for rows in inputs.parameters:
        if is_additional(rows.group) and rows.basis is not None and inputs.rays is not None:
            finite = np.flatnonzero(np.isfinite(inputs.rays.xy_mm).all(axis=1))[:MOST_COLUMNS]
            kinds |= kinds_of_columns(rows.labels, rows.basis[finite], inputs.rays.xy_mm[finite])
    return kinds


@dataclass(frozen=True)
class IdleParameters:
    """Which parameters stay, group by group, and why others do not."""

    kept: tuple[Bool, ...]
    """Tuple of (n, s)."""
    considered: tuple[Bool, ...]
    """Tuple of (n, s). With those that are not significant; empty where there are none."""
    notes: tuple[Note, ...]
    """Empty where all are worth keeping."""


def idle_parameters(inputs: BundleInput, result: BundleResult) -> IdleParameters:
    """Additional parameters that are not worth keeping."""
    kept = [p.free.copy() for p in inputs.parameters]
    considered, notes = [free.copy() for free in kept], list[Note]()
    for group, stays, counts in zip(result.parameters, kept, considered):
        if not is_additional(group.given.group):
            continue
        for k in range(len(stays)):
            e = unit_estimates(group, k, result)
            for removal in stepwise_removal(e)[1] if e is not None else ():
                column = parameter_names(group.given, k).index(removal.name)
                stays[k, column] = False
                counts[k, column] &= removal.by_test
                notes.append(Note("note", f"{group.given.ids[k]}: {removal.name} left out, {removal.reason}"))
    by_test = any((a != b).any() for a, b in zip(kept, considered))
    if by_test:
        notes.append(Note("note", COUNTED))
    return IdleParameters(tuple(kept), tuple(considered) if by_test else (), tuple(notes))


def with_free(parameters: Sequence[ParameterRows], free: Sequence[Bool]) -> tuple[ParameterRows, ...]:
    """The parameters with others of them free."""
    return tuple(replace(p, free=scalars) for p, scalars in zip(parameters, free, strict=True))
