"""What sets of additional parameters have in common, with each other and with the exterior orientation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.exterior_effects import EXTERIOR, exterior_effects, format_grid
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale


def vanishing(columns: Float, names: Sequence[str]) -> set[frozenset[str]]:
    """Names of the columns (n, 2, s) that take part in each combination that vanishes, one per lost rank.

    The null space is brought to row echelon form with full pivoting: each combination has a column of its own.
    """
    flat = columns.reshape(-1, columns.shape[2])
    _, values, rows = np.linalg.svd(flat / np.linalg.norm(flat, axis=0), full_matrices=True)
    null = rows[int((values > 1e-10 * values[0]).sum()) :].copy()
    for k in range(len(null)):
        row, pivot = np.unravel_index(np.argmax(np.abs(null[k:])), null[k:].shape)
        null[[k, k + row]] = null[[k + row, k]]
        null[k] /= null[k, pivot]
        others = np.arange(len(null)) != k
        null[others] -= np.outer(null[others, pivot], null[k])
    return {frozenset(names[j] for j in np.flatnonzero(np.abs(vector) > 1e-6)) for vector in null}


def vanishing_with_exterior(parameters: ParameterSet, scale: SetScale) -> set[frozenset[str]]:
    """The same of a set with the exterior orientation of vertical images of flat terrain."""
    xy = format_grid(scale)
    columns = [parameters.basis(xy, scale), exterior_effects(xy, scale.principal_distance_mm)]
    return vanishing(np.concatenate(columns, axis=2), (*parameters.parameters, *EXTERIOR))


def outside_span(parameters: ParameterSet, scale: SetScale, xy_mm: Float, field_mm: Float) -> Float:
    """A field of image errors (n, 2) less its best fit by a set and the exterior orientation, zero in their span."""
    columns = [parameters.basis(xy_mm, scale), exterior_effects(xy_mm, scale.principal_distance_mm)]
    design = np.concatenate(columns, axis=2).reshape(2 * len(xy_mm), -1)
    fit = np.linalg.lstsq(design, field_mm.ravel(), rcond=None)[0]
    return np.asarray(field_mm - (design @ fit).reshape(-1, 2))
