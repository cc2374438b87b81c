"""sigma0 of a block with weighted additional parameters: that of its observations.

`self_calibration.sigma_um` observes every additional parameter as zero. Such a weight keeps parameters in bounds; it is
no measurement, and cameras are better than it says: a parameter that the image points determine leaves next to nothing
in v'Pv, and yet adds one to the redundancy. So the weights are left out of both,

    sigma0^2 = (v'Pv - sum (p / sigma_p)^2) / (r - sum r_p),      r_p = 1 - C_pp / sigma_p^2

r_p is the redundancy number of the weight: 1 where the image points determine the parameter, 0 where the weight does.
If parameters are as large as their weights say this has the expectation 1 too, as every sum of v'Pv over redundancy
numbers has. Parameters that another block has calibrated are observations, and count.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.observations.poses import ADDITIONAL
from aatri.orientation.bundle.result import BundleResult


def with_observed_sigma0(result: BundleResult) -> BundleResult:
    """The result with the sigma0 of its observations; as it is where no parameter is weighted or none has a covariance.

    Parameters
    ----------
    result : BundleResult
    """
    adjusted, squares, redundancy = result.adjusted, 0.0, 0.0
    for group in result.parameters:
        g = group.given
        if g.group != ADDITIONAL or g.prior.any():
            continue
        variance = np.einsum("nii->ni", group.covariance)
        weighted = g.weighted & g.free & np.isfinite(variance)
        sigma2 = np.where(weighted, np.einsum("nii->ni", g.covariance), 1.0)
        squares += float((group.value**2 / sigma2)[weighted].sum())
        redundancy += float((1.0 - variance / sigma2)[weighted].sum())
    left = adjusted.redundancy - redundancy
    if not redundancy > 0 or not np.isfinite(adjusted.sigma0) or left <= 0.5:
        return result
    of_all = adjusted.sigma0**2 * adjusted.redundancy
    sigma0 = float(np.sqrt(max(of_all - squares, 0.0) / left))
    return replace(result, adjusted=replace(adjusted, sigma0=sigma0), counted=left)
