"""How errors of the observations of an adjusted block move the points and images they touch.

One more way down the tree, with the gains of all records; for a free datum they are carried over to inner constraints.
"""

import numpy as np

from aatri.adjustment.covariance.gains import Gains
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.free_datum import transformation_of
from aatri.orientation.bundle.result import BundleResult


def gains_of_observations(result: BundleResult) -> list[Gains | None]:
    """Gains of each of the observations, for the rows that take part; None where they are exact or none takes part.

    Parameters
    ----------
    result : BundleResult
        Of least squares, with its factor or without.
    """
    adjusted = result.adjusted
    if not adjusted.has_factor:
        return [None] * len(result.observations)
    marginal = marginal_covariances(adjusted, gains_of=(POINT, POSE))
    if result.free is not None:
        determined = np.asarray(np.isfinite(marginal.groups[POINT]).all(axis=(1, 2)))
        transformation = transformation_of(result.free, adjusted, determined)
        for records, gains in zip(adjusted.problem.records, marginal.gains):
            transformation.move_gains(gains, records, adjusted.state)
    in_turn = iter(marginal.gains)
    return [None if o.observed.exact or not len(o.rows) else next(in_turn) for o in result.observations]
