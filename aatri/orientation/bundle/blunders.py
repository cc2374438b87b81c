"""The search for gross errors in a bundle: robust start, data snooping, re-admission; every kind takes part.

1. Adjust by least squares. Where no |w| is above the limit, that is the result.
2. Else adjust once more robustly (Huber's loss on every kind, from there) and reject what lies beyond the limit, with
   the redundancy numbers of the first adjustment: gross errors smear in least squares, hardly in a robust adjustment.
3. Adjust by least squares without it; reject the clearest above the limit, take back what fits; until nothing changes.

Of the records of a point only the largest is rejected in one round, and none far below the largest of all. Two records
of a point with the same test cannot be told apart (the rays of a point of two images): both are rejected, and that is
said. No more than `max_share` of a kind is rejected: where more disagrees the model is wrong, not the data.

Source: Baarda 1968; Huber 1964; docs/formulas.md 6.7, 7.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from aatri.adjustment.statistics.record_tests import tests_of_records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import AdjustedObservations, BundleResult, from_result
from aatri.orientation.bundle.rounds import Round

Method = Literal["robust_snooping", "data_snooping", "none"]

BOUND = 2.0
"""Bound of Huber's loss in the robust adjustment, in standard deviations."""

CLEAR = 0.5
"""Least test of a rejection, as a share of the largest of the round."""

SAME = 1e-3
"""Tests of one point that differ by less, as a share, cannot be told apart."""

WELL_CONTROLLED = 1e-3
"""Components with a smaller redundancy number are not rejected: what controls them could not be told apart."""

ROUNDS = 12

Adjust = Callable[[BundleInput, float | None], BundleResult]
"""(block, bound of Huber's loss or None) -> adjusted block, with covariances where there is no loss."""


@dataclass(frozen=True)
class Rule:
    """How gross errors are searched for.

    Attributes
    ----------
    method : str
    limit : float
        |w| above which an observation is rejected.
    max_share : float
        Largest share of a kind that is rejected.
    """

    method: Method = "robust_snooping"
    limit: float = 4.0
    max_share: float = 0.05


def search(given: BundleInput, adjust: Adjust, rule: Rule) -> Round:
    """Adjust a block and leave out its gross errors.

    Parameters
    ----------
    given : BundleInput
        What earlier stages have rejected is not active, and may come back.
    adjust : callable
    rule : Rule

    Raises
    ------
    GeometryError, ConvergenceError
        If the block cannot be adjusted, robustly neither.
    """
    try:
        result = adjust(given, None)
    except (ConvergenceError, GeometryError):
        if rule.method != "robust_snooping":
            raise
        given = from_result(given, adjust(given, BOUND))
        result = adjust(given, None)
    tests = record_tests(result)
    rejected = [o.rejected if o.rejected is not None else np.zeros(len(o), dtype=bool) for o in given.observed]
    undecided: set[str] = set()
    if rule.method == "robust_snooping" and _wrong(given, tests, rejected, rule, undecided):
        robust = adjust(from_result(given, result), BOUND)
        far = _robust_tests(result, robust)
        for i, rows in _wrong(given, far, rejected, rule, undecided, clear=0.0).items():
            rejected[i] = rejected[i].copy()
            rejected[i][rows] = True
        given = _without(from_result(given, robust), rejected)
        result = adjust(given, None)
        tests = record_tests(result)
    taken_back = [np.zeros(len(o), dtype=bool) for o in given.observed]
    for _ in range(ROUNDS):
        wrong = _wrong(given, tests, rejected, rule, undecided)
        if wrong:
            rejected = [r.copy() for r in rejected]
            for i, rows in wrong.items():
                rejected[i][rows] = True
        else:
            back = [r & ~t & (x < rule.limit) for r, t, x in zip(rejected, taken_back, tests)]
            if not any(b.any() for b in back):
                break
            rejected = [r & ~b for r, b in zip(rejected, back)]
            taken_back = [t | b for t, b in zip(taken_back, back)]
        given = _without(from_result(given, result), rejected)
        result = adjust(given, None)
        tests = record_tests(result)
    return Round(given, result, tuple(_notes(given, tests, rejected, rule, undecided)))


def record_tests(result: BundleResult) -> tuple[Float, ...]:
    """Largest |w| of the components of each record, for every kind; NaN without test."""
    return tuple(tests_of(o, result.adjusted.state) for o in result.observations)


def tests_of(found: AdjustedObservations, state: State) -> Float:
    """Largest |w| of the components of each record of one kind, (n,); NaN without test."""
    records, rows = found.observed.records, found.rows
    test = np.full(len(found.observed), np.nan)
    if len(rows):
        tests = tests_of_records(records.take(rows), state, found.covariance[rows])
        controlled = np.einsum("nii->ni", tests.redundancy) > WELL_CONTROLLED
        test[rows] = _largest(np.where(controlled, np.abs(tests.w), np.nan))
    return test


def _robust_tests(result: BundleResult, robust: BundleResult) -> tuple[Float, ...]:
    """The same with the residuals of the robust adjustment and the cofactors of least squares."""
    observations = tuple(replace(o, observed=r.observed) for o, r in zip(result.observations, robust.observations))
    return record_tests(replace(result, observations=observations, adjusted=robust.adjusted))


def _largest(w: Float) -> Float:
    known = np.isfinite(w)
    return np.where(known.any(axis=1), np.where(known, w, -1.0).max(axis=1), np.nan)


def _wrong(
    given: BundleInput, tests: tuple[Float, ...], rejected: list[Bool], rule: Rule, undecided: set[str],
    clear: float = CLEAR,
) -> dict[int, Int]:  # fmt: skip
    """Records to reject: by place of the observations, the rows."""
    place, row, point, test = _candidates(given, tests, rejected)
    above = np.flatnonzero(test > rule.limit)
    above = above[np.argsort(-test[above], kind="stable")]
    above = above[test[above] >= clear * test[above[0]]] if len(above) else above
    room = [_room(o.records.active | r, r, rule.max_share) for o, r in zip(given.observed, rejected)]
    by_point = np.argsort(point, kind="stable")
    sorted_points = point[by_point]
    taken: set[int] = set()
    found: dict[int, list[int]] = {}
    for k in above.tolist():
        if int(point[k]) in taken:
            continue
        if point[k] >= 0:
            taken.add(int(point[k]))
        if room[place[k]] <= 0:  # nor is another observation of the point blamed in its place
            continue
        alike = [k]
        if point[k] >= 0:
            first, last = np.searchsorted(sorted_points, [point[k], point[k] + 1])
            mates = by_point[first:last]
            alike = mates[np.abs(test[mates] - test[k]) < SAME * test[k]].tolist()
        if len(alike) > 1:
            undecided.add(_together(given, place[alike], row[alike]))
        for j in alike:
            found.setdefault(int(place[j]), []).append(int(row[j]))
            room[place[j]] -= 1
    return {i: np.array(rows) for i, rows in found.items()}


def _candidates(given: BundleInput, tests: tuple[Float, ...], rejected: list[Bool]) -> tuple[Int, Int, Int, Float]:
    """Active records with a test: place of their observations, row, point (-1 none), test."""
    parts = []
    for i, (o, test, out) in enumerate(zip(given.observed, tests, rejected)):
        if o.exact or o.components:
            continue
        rows = np.flatnonzero(np.isfinite(test) & ~out & o.records.active)
        touched = dict(o.records.touches)
        point = touched[POINT][rows].astype(np.int64) if POINT in touched else np.full(len(rows), -1)
        parts.append((np.full(len(rows), i), rows, point, test[rows]))
    if not parts:
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing, nothing, np.zeros(0)
    place, row, point, test = (np.concatenate(p) for p in zip(*parts))
    return place, row, point, test


def _room(of: Bool, rejected: Bool, share: float) -> int:
    return int(np.ceil(share * of.sum())) - int(rejected.sum())


def _together(given: BundleInput, place: Int, row: Int) -> str:
    names = []
    for i, r in zip(place.tolist(), row.tolist()):
        image, point = given.observed[i].names(np.array([r]))
        names.append("/".join(x for x in (str(image[0]), str(point[0])) if x) + f" ({given.observed[i].kind})")
    return " or ".join(names)


def _without(given: BundleInput, rejected: list[Bool]) -> BundleInput:
    """The block as it was taken from its tables, less what is rejected."""
    observed = tuple(o.again().without(r) for o, r in zip(given.observed, rejected))
    return replace(given, observed=observed)


def _notes(
    given: BundleInput, tests: tuple[Float, ...], rejected: list[Bool], rule: Rule, undecided: set[str]
) -> list[Note]:
    notes = []
    for o, test, out in zip(given.observed, tests, rejected):
        if out.any():
            image, point = o.names(np.flatnonzero(out))
            ids = tuple("/".join(x for x in pair if x) for pair in zip(image.tolist(), point.tolist()))
            notes.append(Note("warning", f"{o.kind}: {int(out.sum())} of {len(o)} rejected as gross errors", ids))
        left = o.records.active & ~out & (test > rule.limit)
        if left.any():
            image, point = o.names(np.flatnonzero(left))
            ids = tuple("/".join(x for x in pair if x) for pair in zip(image.tolist(), point.tolist()))
            text = (
                f"{o.kind}: {int(left.sum())} of {len(o)} are beyond {rule.limit:g} sigma and stay, for no more than "
                f"{rule.max_share:.0%} of a kind is rejected: where more disagrees the model is wrong, not the data"
            )
            notes.append(Note("warning", text, ids))
    if undecided:
        notes.append(Note("warning", "gross errors that cannot be attributed, all rejected", tuple(sorted(undecided))))
    return notes
