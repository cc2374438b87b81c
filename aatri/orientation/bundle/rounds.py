"""A bundle in rounds: once with what earlier stages left, once more with what of their rejections fits after all.

Another round follows where additional parameters are to go that are not worth keeping.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.record_tests import record_tests
from aatri.adjustment.statistics.removal import size_of_idle
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Int
from aatri.errors import ResourceError, SpecError
from aatri.geometry.rotations import log_rotation
from aatri.notes import Note
from aatri.observations.observed import Observed
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.parameter_estimates import idle_parameters, with_free
from aatri.orientation.bundle.result import Adjust, BundleResult, from_result

Rebuilt = Callable[[BundleInput, tuple[ParameterRows, ...]], BundleInput]
"""The block with other parameters."""

Key = tuple[str, int]
"""An observation, whatever else is in the list: its kind and the row of its table; without one, -1 less its place."""


def keys_of(o: Observed, rows: Int | Bool) -> tuple[Key, ...]:
    """Keys of some observations of a kind."""
    place = np.arange(len(o))[rows]
    return tuple((o.kind, int(row)) for row in np.where(o.row[place] >= 0, o.row[place], -1 - place))


def with_keys(o: Observed, keys: Collection[Key]) -> Bool:
    """Which observations of a kind have one of the keys, (n,)."""
    kind_rows = [row for kind, row in keys if kind == o.kind]
    has_key = np.isin(o.row, [row for row in kind_rows if row >= 0])
    place = [-1 - row for row in kind_rows if row < 0]
    has_key[[k for k in place if k < len(o) and o.row[k] < 0]] = True
    return has_key


@dataclass(frozen=True)
class OtherNumber:
    """An image point that fits another ground point: rows of the image points, of the points."""

    row: int
    point: int


@dataclass(frozen=True)
class AdjustedBlock:
    """An adjusted block and what led to it."""

    inputs: BundleInput
    """What is rejected is not active in it."""
    result: BundleResult
    notes: tuple[Note, ...] = ()
    undecided: tuple[Key, ...] = ()
    """Left out though only some are wrong, and nothing tells which."""
    above: tuple[Key, ...] = ()
    """Used, though their test is above the limit."""
    swapped: tuple[tuple[Key, Key], ...] = ()
    """Numbers to exchange."""
    renumbered: tuple[OtherNumber, ...] = ()
    """Image points that fit another ground point."""
    scale: float = 1.0
    """Of the standard deviations of the class with the most redundancy, over those given, where they do not fit."""
    considered: tuple[Bool, ...] = ()


def readmitted(adjusted: AdjustedObservations, state: State, limit: float = 3.0) -> Bool:
    """Which of the rejected rows fit the adjusted block after all; what cannot be predicted does not.

    A record fits where its test, of the prediction from everything else, is within the limit: so it is with every kind
    of observation.

    Parameters
    ----------
    state : mapping
        The adjusted block.
    limit : float
        In standard deviations.

    Returns
    -------
    (n,) bool
    """
    fits = np.zeros(len(adjusted.observed), dtype=bool)
    rejected = adjusted.observed.rejected
    if rejected is None:
        return fits
    rows = adjusted.rows[rejected[adjusted.rows]]
    covariance = adjusted.covariance[rows]
    if not np.isfinite(adjusted.covariance[adjusted.rows]).any():
        covariance = np.zeros_like(covariance)  # adjusted without: held against the measurement's own alone
    records = adjusted.observed.records.take(rows)
    tests = record_tests(records, state, covariance, whitened_residuals(records, state, np.arange(len(rows))))
    fits[rows[tests.test <= limit]] = True
    return fits


def with_readmission(inputs: BundleInput, adjust: Adjust) -> AdjustedBlock:
    """Adjust without what was rejected, then once more with those of it that fit."""
    result = adjust(inputs)
    fits = [readmitted(o, result.adjusted.state) for o in result.observations]
    if not any(f.any() for f in fits):
        return AdjustedBlock(inputs, result)
    observed, notes = [], []
    for o, readmitted_rows in zip(inputs.observed, fits):
        if o.rejected is None or not readmitted_rows.any():
            observed.append(o)
            continue
        observed.append(o.again().without(o.rejected & ~readmitted_rows))
        image, point = o.names(np.flatnonzero(readmitted_rows))
        ids = tuple("/".join(part for part in pair if part) for pair in zip(image.tolist(), point.tolist()))
        count = f"{int(readmitted_rows.sum())} of {int(o.rejected.sum())}"
        text = f"{o.kind}: {count} rejected fit the block and are re-admitted"
        notes.append(Note("note", text, ids))
    readmitted_block = from_result(replace(inputs, observed=tuple(observed)), result)
    return AdjustedBlock(readmitted_block, adjust(readmitted_block), tuple(notes))


def without_idle_parameters(before: AdjustedBlock, adjust: Adjust, rebuilt: Rebuilt) -> AdjustedBlock:
    """Adjust once more without additional parameters that are not worth keeping.

    Parameters
    ----------
    before : AdjustedBlock
        With standard deviations.

    Raises
    ------
    SpecError, ResourceError
        If there are no standard deviations to judge by.
    """
    if not before.result.adjusted.has_factor:
        raise ResourceError(
            "self_calibration.remove needs standard deviations, and conjugate gradients give none",
            remedy="raise memory_gb, or leave out remove",
        )
    if not any(np.isfinite(p.covariance).any() for p in before.result.parameters):
        raise SpecError("self_calibration.remove needs standard deviations", remedy="standard_deviations: true")
    idle = idle_parameters(before.inputs, before.result)
    if not idle.notes:
        return before
    start = from_result(before.inputs, before.result)
    reduced = rebuilt(start, with_free(start.parameters, idle.kept))
    notes = (*before.notes, *idle.notes)
    return replace(before, inputs=reduced, result=adjust(reduced), notes=notes, considered=idle.considered)


def with_considered(done: AdjustedBlock, adjust: Adjust, rebuilt: Rebuilt) -> AdjustedBlock:
    """The same result; what was left out as not significant counts in the covariances of points and orientations.

    A parameter that is held at zero errs by what it truly is, p. Of a size that no test has found it may still be: with
    its estimate p_f and its covariance P where it is free

        E(p p') = E(w) P + E(w^2) p_f p_f'         (`size_of_idle`)

    is carried on to all else, where P makes up the difference of the covariances with and without it, and p_f that of
    the results. Parameters keep the covariance of the set that is left.

    Parameters
    ----------
    done : AdjustedBlock
        After all changes of weights.

    Source: Tapley, Schutz, Born 2004, Statistical orbit determination, 6.3 (consider parameters).
    """
    if not done.considered:
        return done
    reduced = done.result
    start = from_result(done.inputs, reduced)
    complete = adjust(rebuilt(start, with_free(start.parameters, done.considered)))
    turned = log_rotation(complete.poses.ground_from_image @ reduced.poses.ground_from_image.swapaxes(1, 2))
    moved = {
        POINT: complete.xyz_m - reduced.xyz_m,
        POSE: np.concatenate([complete.poses.position_m - reduced.poses.position_m, turned], axis=1),
    }
    share, squared = size_of_idle(*_joint_test(complete, done.inputs.parameters))
    counted = {
        name: (1 - share) * reduced.covariances[name]
        + share * complete.covariances[name]
        + squared * np.einsum("ni,nj->nij", d, d)
        for name, d in moved.items()
        if name in reduced.covariances
    }
    return replace(done, result=replace(reduced, covariances={**reduced.covariances, **counted}))


def _joint_test(complete: BundleResult, reduced: tuple[ParameterRows, ...]) -> tuple[float, int]:
    """Chi-square against zero of the parameters that are not free any more, unit by unit, and their number."""
    chi_square, count = 0.0, 0
    for p, rows in zip(complete.parameters, reduced, strict=True):
        for k in range(len(rows.free)):
            idle = np.flatnonzero(p.given.free[k] & ~rows.free[k])
            value, P = p.value[k, idle], p.covariance[k][np.ix_(idle, idle)]
            if len(idle) and np.isfinite(P).all():
                chi_square += float(value @ np.linalg.solve(P, value))
                count += len(idle)
    return chi_square, count
