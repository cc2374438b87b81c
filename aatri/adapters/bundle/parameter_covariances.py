"""Covariances of all camera parameters of an adjustment, within each camera, session or image and between them.

Additional parameters are told in their classical units, p' = f p: their covariances are C' = f C f'. Those between
different units need a solve per unit; with more than `MOST` parameters only those between units that images share are
found, and of each image with itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aatri.adapters.solution import stacked
from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.arrays import Float, Int
from aatri.artifacts.solution import ParameterCovariances
from aatri.notes import Note
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

MOST = 400
"""With more parameters than this, those of single images are not held against other units."""


@dataclass(frozen=True)
class TableRows:
    """Where the parameters of a group stand in the table of parameters.

    Attributes
    ----------
    adjusted : AdjustedParameters
    row : (n, s) int
        -1 where a parameter is not in the table.
    factor : (n, s) float64
        Value in the table over value in the adjustment.
    """

    adjusted: AdjustedParameters
    row: Int
    factor: Float


def parameter_covariances(
    result: BundleResult, tables: Sequence[TableRows]
) -> tuple[ParameterCovariances | None, tuple[Note, ...]]:
    """Covariances of the parameters of all groups, each pair once; None where there are no parameters.

    Parameters
    ----------
    result : BundleResult
    tables : sequence of TableRows
    """
    units = [(t, k) for t in tables for k in range(len(t.row)) if (t.row[k] >= 0).any()]
    if not units:
        return None, ()
    found = [_pair(t, k, t, k, t.adjusted.covariance[k]) for t, k in units]
    pairs, notes = _between(units, result)
    names = [((a.adjusted.given.group, i), (b.adjusted.given.group, j)) for (a, i), (b, j) in pairs]
    if names:
        for ((a, i), (b, j)), cross in zip(pairs, covariances_of_pairs(result.adjusted, names)):
            found.append(_pair(a, i, b, j, cross))
    return stacked(found), notes


Unit = tuple[TableRows, int]


def _between(units: Sequence[Unit], result: BundleResult) -> tuple[list[tuple[Unit, Unit]], tuple[Note, ...]]:
    """Pairs of units whose covariances are asked for, in an order in which one second unit follows itself."""
    known = [u for u in units if u[0].adjusted.given.free[u[1]].any() and _finite(u)]
    if not result.adjusted.has_factor or result.adjusted.down_weighted or len(known) < 2:
        return [], ()
    pairs = [(a, b) for b, a in combinations(known, 2)]
    if sum(int(t.adjusted.given.free[k].sum()) for t, k in known) <= MOST:
        return pairs, ()
    shared = [(a, b) for a, b in pairs if not (a[0].adjusted.given.per_image or b[0].adjusted.given.per_image)]
    text = (
        f"covariances of camera parameters: more than {MOST}; those of single images are told within each image, not "
        "with other images and cameras"
    )
    return shared, (Note("note", text),)


def _finite(unit: Unit) -> bool:
    table, k = unit
    free = table.adjusted.given.free[k]
    return bool(np.isfinite(table.adjusted.covariance[k][np.ix_(free, free)]).all())


def _pair(a: TableRows, i: int, b: TableRows, j: int, covariance: Float) -> ParameterCovariances:
    """Covariances of two units, or of one with itself, the earlier row first."""
    same = a is b and i == j
    first, second = np.meshgrid(a.row[i], b.row[j], indexing="ij")
    values = covariance * np.outer(a.factor[i], b.factor[j])
    told = (first >= 0) & (second >= 0) & ((first <= second) | np.bool_(not same))
    low, high = np.minimum(first, second)[told], np.maximum(first, second)[told]
    return ParameterCovariances(first=low.astype(np.int32), second=high.astype(np.int32), covariance=values[told])
