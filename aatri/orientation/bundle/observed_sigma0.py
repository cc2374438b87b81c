"""sigma0 of a block with weighted additional parameters: that of its observations.

`self_calibration.sigma_um` observes every additional parameter as zero. Such a weight keeps parameters in bounds; it is
no measurement, and cameras are better than it says: a parameter that the image points determine leaves next to nothing
in v'Pv, and yet adds one to the redundancy. So the weights are left out of both,

    sigma0^2 = (v'Pv - sum (p / sigma_p)^2) / (r - sum r_p),      r_p = 1 - C_pp / sigma_p^2

r_p is the redundancy number of the weight: 1 where the image points determine the parameter, 0 where the weight does.
If parameters are as large as their weights say this has the expectation 1 too, as every sum of v'Pv over redundancy
numbers has. Parameters that another block has calibrated are observations, and count.

Where no standard deviations were asked for, C_pp of these parameters alone is found from the factor, and sigma0 is the
same; conjugate gradients have no factor, all is counted, and a note says so.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.arrays import Float
from aatri.notes import Note
from aatri.observations.poses import ADDITIONAL
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

MOST_SOLVES = 20
"""With more units of parameters (images, sessions) the way down the tree is quicker than a solve for each."""

ALL_COUNTED = (
    "sigma0 counts the weights of additional parameters as observations, and comes out a little small: without the "
    "factor of the normal equations, which conjugate gradients do not have, their redundancy is not known"
)


def with_observed_sigma0(result: BundleResult) -> BundleResult:
    """The result with the sigma0 of its observations; as it is where no parameter is weighted."""
    adjusted, squares, redundancy = result.adjusted, 0.0, 0.0
    weighted_groups = [p for p in result.parameters if _is_weighted(p)]
    if not weighted_groups or not np.isfinite(adjusted.sigma0) or adjusted.down_weighted:
        return result
    for group in weighted_groups:
        g = group.given
        covariance = _covariance(group, result)
        if covariance is None:
            return replace(result, notes=(*result.notes, Note("warning", ALL_COUNTED)))
        variance = np.einsum("nii->ni", covariance)
        weighted = g.weighted & g.free & np.isfinite(variance)
        sigma2 = np.where(weighted, np.einsum("nii->ni", g.covariance), 1.0)
        squares += float((group.value**2 / sigma2)[weighted].sum())
        redundancy += float((1.0 - variance / sigma2)[weighted].sum())
    redundancy_left = adjusted.redundancy - redundancy
    if not redundancy > 0 or redundancy_left <= 0.5:
        return result
    all_squares = adjusted.sigma0**2 * adjusted.redundancy
    sigma0 = float(np.sqrt(max(all_squares - squares, 0.0) / redundancy_left))
    return replace(result, adjusted=replace(adjusted, sigma0=sigma0), counted=redundancy_left)


def _is_weighted(parameters: AdjustedParameters) -> bool:
    """Whether these are additional parameters observed as zero."""
    g = parameters.given
    return g.group == ADDITIONAL and not g.prior.any() and bool((g.weighted & g.free).any())


def _covariance(parameters: AdjustedParameters, result: BundleResult) -> Float | None:
    """Covariances of the units, (n, s, s), computed here where they were not asked for; None without a factor."""
    g, adjusted = parameters.given, result.adjusted
    free = g.free.any(axis=1)
    if np.isfinite(parameters.covariance[free]).any():
        return parameters.covariance
    if not adjusted.has_factor:
        return None
    if free.sum() > MOST_SOLVES:
        return marginal_covariances(adjusted, blocks=False).groups[g.group]
    covariance = np.full(parameters.covariance.shape, np.nan)
    units = np.flatnonzero(free)
    covariance[units] = covariances_of_pairs(adjusted, [((g.group, int(k)), (g.group, int(k))) for k in units])
    return covariance
