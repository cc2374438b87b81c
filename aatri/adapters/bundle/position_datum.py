"""Observed positions in another frame than control: a constant shift, found by an adjustment that leaves it open.

Where control and positions contradict each other the block is adjusted once more, with all observations as they were
given and one shift of all positions as unknown. If that fits where the other does not, the shift is told, with its
value: heights of a GNSS receiver count from the ellipsoid, those of control from the geoid; another datum shifts the
plan too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adjustment.records import whitened
from aatri.adjustment.statistics.global_test import global_test
from aatri.errors import AatriError
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.drift import DRIFT, drift
from aatri.observations.poses import POSE
from aatri.observations.positions import KIND as POSITION
from aatri.observations.positions import PositionOptions
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult

SIGNIFICANT = 5.0
"""Shifts beyond so many standard deviations are told."""
BETTER = 0.5
"""Share of sigma0 that is left, where gross errors keep it from being as expected."""
MANY = 0.1
"""A constant contradicts most positions, and control with them: a larger share than this is rejected."""
MISFIT = 1.5
"""Or their residuals, or those of all, are so many times their standard deviations; looking costs an adjustment."""
FEWEST = 3


def shift_notes(
    given: BundleInput, done: BundleInput, result: BundleResult, adjust: Callable[[BundleInput], BundleResult]
) -> list[Note]:
    """A warning of a shift between positions and control.

    Parameters
    ----------
    given : BundleInput
        The block as it was given.
    done : BundleInput
        The same with what was rejected.
    result : BundleResult
        Of the adjustment.
    adjust : callable
        Adjusts a block.
    """
    if given.given is None or not _contradicted(done, result):
        return []
    plain = [o for o in given.observed if o.kind == POSITION and {g for g, _ in o.records.touches} == {POSE}]
    if sum(len(o) for o in plain) < FEWEST or len([o for o in given.observed if o.kind == POSITION]) > len(plain):
        return []
    shifted = drift(given.given, PositionOptions(drift="shift", per="block"))
    others = tuple(o.again() for o in given.observed if o.kind != POSITION)
    try:
        again = adjust(replace(given, observed=(*others, *shifted)))
    except AatriError:
        return []
    sigma0 = again.adjusted.sigma0
    sigma = np.sqrt(np.diagonal(again.covariances[DRIFT][0])[:3]) * max(1.0, sigma0)
    given_axes = np.flatnonzero(sigma > 0)
    s, sigma = again.adjusted.state[DRIFT][0, given_axes], sigma[given_axes]
    fits = global_test(sigma0, again.adjusted.redundancy).verdict == "fits" or sigma0 < BETTER * result.adjusted.sigma0
    shifted_axes = given_axes[np.abs(s) > SIGNIFICANT * sigma]
    if not fits or not len(shifted_axes):
        return []
    values = ", ".join(f"{a:.3f} (+- {b:.3f})" for a, b in zip(s, sigma))
    alone = shifted_axes.tolist() == [2]
    what = "heights of positions and control count from different surfaces" if alone else "positions and control differ"
    declare = "declare `vertical` of the frames, or `undulation`" if alone else "declare the frames of both"
    text = (
        f"{what} by a constant: positions less control {values} m in {', '.join('XYZ'[k] for k in given_axes)}; with "
        f"this shift sigma0 is {sigma0:.3g} instead of {result.adjusted.sigma0:.3g}; {declare}, or leave the shift "
        "open: positions: {drift: shift, per: block}"
    )
    return [Note("warning", text)]


def _contradicted(done: BundleInput, result: BundleResult) -> bool:
    """Positions and control are there, and something is wrong with them or with the block."""
    kinds = {o.kind for o in done.observed if len(o)}
    if not {POSITION, CONTROL} <= kinds or result.adjusted.down_weighted:
        return False
    for o in done.observed:
        if o.kind not in (POSITION, CONTROL) or not len(o):
            continue
        used = np.flatnonzero(o.records.active)
        if o.rejected is not None and np.count_nonzero(o.rejected) > MANY * len(o):
            return True
        if len(used) and float(np.mean(whitened(o.records, result.adjusted.state, used)[0] ** 2)) > MISFIT**2:
            return True
    return result.adjusted.sigma0 > MISFIT
