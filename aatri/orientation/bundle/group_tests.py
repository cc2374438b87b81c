"""Whether the standard deviations of control, positions, distances ... fit their residuals, each kind by itself.

    s^2 = sum v'P v / sum (1 - tr(L B C B'L'))

with B the Jacobian of a record, C the covariance of the unknowns it touches, L its whitener: the
sum below is the redundancy of the group. A few records hardly move sigma0 of the block, so standard deviations that are
wrong by a unit pass its test: those of control in mm taken as m, positions that claim too much.

Source: Foerstner 1979 (redundancy numbers of groups); Kraus, Photogrammetry, weights of groups of observations.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.global_test import GlobalTest, global_test
from aatri.notes import Note
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.result import BundleResult

OFF = 3.0
"""Standard deviations wrong by less than this factor, either way, are left to variance components."""

LEAST_REDUNDANCY = 5.0

CLEARLY, CLEAR_REDUNDANCY = 2.0, 10.0
"""Too small by this factor is told, too, with so much redundancy: by chance it happens once in 50,000."""


def sigma_notes(result: BundleResult) -> list[Note]:
    """A warning for each group whose standard deviations are wrong by a large factor.

    Parameters
    ----------
    result : BundleResult
        Without covariances nothing is said.
    """
    return list(_notes(result))


def _notes(result: BundleResult) -> Iterator[Note]:
    for found in result.observations:
        o = found.observed
        is_ray = {POSE, POINT} <= {group for group, _ in o.records.touches}  # nearly all there is: sigma0 tells of them
        if o.exact or o.components or is_ray or result.adjusted.down_weighted:
            continue
        test = _group_test(found, result)
        if test is None or test.low <= test.sigma0 <= test.high:
            continue
        if 1 / OFF < test.sigma0 < (CLEARLY if test.redundancy >= CLEAR_REDUNDANCY else OFF):
            continue
        text = f"{o.kind}: sigma0 of these {len(found.rows)} observations alone is {test.sigma0:.3g}"
        if test.sigma0 < 1:
            why = f"their standard deviations are about {1 / test.sigma0:.2g} times too large: a unit?"
        else:
            why = f"their standard deviations are about {test.sigma0:.2g} times too small, or gross errors are in them"
        yield Note("warning", f"{text} (redundancy {test.redundancy}): {why}")


def _group_test(found: AdjustedObservations, result: BundleResult) -> GlobalTest | None:
    """sigma0 of a group; None where its redundancy is small or not known."""
    o = found.observed
    rows = np.flatnonzero(found.used)
    rows = rows[np.isfinite(found.covariance[rows]).all(axis=(1, 2))]
    if not len(rows):
        return None
    v = whitened_residuals(o.records, result.adjusted.state, rows)
    count = int(o.records.observed_components()[rows].sum())
    redundancy = count - float(np.einsum("nii->", found.covariance[rows]))
    if redundancy < LEAST_REDUNDANCY:
        return None
    return global_test(float(np.sqrt((v**2).sum() / redundancy)), round(redundancy))
