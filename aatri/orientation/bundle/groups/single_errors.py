"""What the single observation explains that explains most, beside which a group of observations must stand.

    gain = v'v with it - v'v without it

A wrong exact coordinate bends the block as a lens does, and has no residual: for its gain it is observed.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.arrays import Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.exact_coordinates import exact_as_observed, is_testable
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.tested_block import gains_of
from aatri.orientation.bundle.groups.as_unknowns import with_groups
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.result import BundleResult, from_result


def attempted(adjusted: Callable[[], BundleResult | None]) -> BundleResult | None:
    """An adjustment; None where it fails."""
    try:
        return adjusted()
    except (ConvergenceError, GeometryError):
        return None


def largest_gain_root(result: BundleResult) -> float:
    """Root of the most that leaving out a single observation, all its coordinates, gains."""
    return float(np.sqrt(max((_gains(o, result).max(initial=0.0) for o in result.observations), default=0.0)))


def _gains(o: AdjustedObservations, result: BundleResult) -> Float:
    """What leaving out each observation in use would gain; 0 of what has no test."""
    rows = np.flatnonzero(o.used)
    if o.observed.exact or o.observed.components or not len(rows):
        return np.zeros(len(rows))
    return np.nan_to_num(gains_of(o, result.adjusted.state, rows))


def cost_without_worst(block: BundleInput, result: BundleResult, adjust: Adjust) -> float:
    """v'v of least squares without the observation that gains most, exact ones too; infinite where none does.

    Parameters
    ----------
    result : BundleResult
        Of the block, by least squares.
    """
    start = from_result(block, result)

    def adjusted_with(observed: Sequence[Observed]) -> BundleResult | None:
        return attempted(lambda: adjust(replace(start, observed=tuple(observed)), AdjustOptions(coarse=True)))

    as_observed = exact_as_observed(start, result.point_covariance_m2)
    tested = result if as_observed is None else adjusted_with(as_observed) or result
    gains = [_gains(o, tested) for o in tested.observations]
    place = int(np.argmax([gain.max(initial=0.0) for gain in gains]))
    if not gains[place].max(initial=0.0) > 0:
        return float("inf")
    observed = list(start.observed)
    o = observed[place]
    rejected = np.zeros(len(o), dtype=bool) if o.rejected is None else o.rejected.copy()
    rejected[np.flatnonzero(tested.observations[place].used)[gains[place].argmax()]] = True
    observed[place] = o.again().without(rejected)
    without = adjusted_with(observed)
    return float("inf") if without is None else without.adjusted.cost


def beyond_exact(
    block: BundleInput, result: BundleResult, adjust: Adjust, groups: Sequence[Group], candidates: Sequence[Group]
) -> list[Group]:
    """Candidates that leave less than the block does without the worst observation, where coordinates are exact.

    Parameters
    ----------
    result : BundleResult
        Of the block with `groups` carried, its single gross errors left out: an exact coordinate may be one that stays,
        as nothing tells which of a few is wrong.
    """
    if not any(map(is_testable, block.observed)):
        return list(candidates)
    start = from_result(block, result)
    least = cost_without_worst(start, result, adjust)

    def cost_with(group: Group) -> float:
        carried = attempted(lambda: adjust(with_groups(start, [*groups, group]), AdjustOptions(coarse=True)))
        return float("-inf") if carried is None else carried.adjusted.cost  # what fails is tried with its search

    return [group for group in candidates if cost_with(group) < least]
