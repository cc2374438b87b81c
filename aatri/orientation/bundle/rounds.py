"""A bundle in rounds: once with what earlier stages left, once more with what of their rejections fits after all.

Another round follows where additional parameters are to go that are not worth keeping.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Bool
from aatri.errors import ResourceError, SpecError
from aatri.notes import Note
from aatri.observations.parameters import ParameterRows
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.other_numbers import OtherNumber
from aatri.orientation.bundle.blunders.swaps import Swap
from aatri.orientation.bundle.parameter_notes import without_idle
from aatri.orientation.bundle.readmission import readmitted
from aatri.orientation.bundle.result import BundleResult, from_result

Adjust = Callable[[BundleInput], BundleResult]


@dataclass(frozen=True)
class Round:
    """An adjusted block and what led to it.

    Attributes
    ----------
    given : BundleInput
        What is rejected is not active in it.
    result : BundleResult
    notes : tuple of Note
    undecided : tuple of (n,) bool
        Of all observations, kind by kind: left out though only some are wrong, and nothing tells which.
    above : tuple of (n,) bool
        Used, though their test is above the limit.
    swapped : tuple of Swap
        Numbers to exchange.
    renumbered : tuple of OtherNumber
        Image points that fit another ground point.
    """

    given: BundleInput
    result: BundleResult
    notes: tuple[Note, ...] = ()
    undecided: tuple[Bool, ...] = ()
    above: tuple[Bool, ...] = ()
    swapped: tuple[Swap, ...] = ()
    renumbered: tuple[OtherNumber, ...] = ()


def with_readmission(given: BundleInput, adjust: Adjust) -> Round:
    """Adjust without what was rejected, then once more with those of it that fit.

    Parameters
    ----------
    given : BundleInput
    adjust : callable
    """
    result = adjust(given)
    fits = [readmitted(o, result.adjusted.state) for o in result.observations]
    if not any(f.any() for f in fits):
        return Round(given, result)
    observed, notes = [], []
    for o, back in zip(given.observed, fits):
        if o.rejected is None or not back.any():
            observed.append(o)
            continue
        observed.append(o.again().without(o.rejected & ~back))
        image, point = o.names(np.flatnonzero(back))
        ids = tuple("/".join(part for part in pair if part) for pair in zip(image.tolist(), point.tolist()))
        text = f"{o.kind}: {int(back.sum())} of {int(o.rejected.sum())} rejected fit the block and are re-admitted"
        notes.append(Note("note", text, ids))
    again = from_result(replace(given, observed=tuple(observed)), result)
    return Round(again, adjust(again), tuple(notes))


def without_idle_parameters(
    before: Round, adjust: Adjust, rebuilt: Callable[[BundleInput, tuple[ParameterRows, ...]], BundleInput]
) -> Round:
    """Adjust once more without additional parameters that are not worth keeping.

    Parameters
    ----------
    before : Round
        With standard deviations.
    adjust : callable
    rebuilt : callable
        (block, parameters) -> the block with other parameters.

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
    parameters, notes = without_idle(before.given, before.result)
    if parameters is None:
        return before
    reduced = rebuilt(before.given, parameters)
    return replace(before, given=reduced, result=adjust(reduced), notes=(*before.notes, *notes))
