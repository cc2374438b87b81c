"""A block that hangs on too little: points far less certain than their image points make them.

Seen: control nearly on a line, or close together, determines a datum in the sense of rank, and a block turned by 4 mrad
with it; strips hang on few points; parameters free each other. Nothing in residuals or sigma0 shows that.
Test: a twentieth of the points has a standard deviation beyond `WEAK_DATUM` times what an image point measures on the
ground, sigma / c times the distance. The least certain direction is named, mostly a motion of the whole block. Of a
free datum without control and positions the standard deviations say where it rests, not what is weak: no test then.
"""

import numpy as np

from aatri.adjustment.openness.nearly_open import least_certain
from aatri.adjustment.statistics.limits import WEAK_DATUM
from aatri.adjustment.stepping.adjusted import factor_of
from aatri.checks.finding import Finding
from aatri.checks.limits import WEAK_SHARE
from aatri.observations.control import KIND as CONTROL
from aatri.observations.poses import POINT
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.seen_distances import on_ground_m
from aatri.units import about

REMEDY = "give control spread over the block; join strips by more points; weight parameters that free each other"


def weak_datum(inputs: BundleInput, result: BundleResult, scale: float = 1.0) -> list[Finding]:
    """A warning that names what a block hardly determines as a whole.

    Parameters
    ----------
    scale : float
        Of the standard deviations of image points in use, which the covariances follow, over those given.
    """
    on_ground, adjusted = scale * on_ground_m(inputs.rays, inputs.poses, inputs.xyz_m), result.adjusted
    tied = any(o.used.any() for o in result.observations if o.observed.kind in (CONTROL, POSITION))
    if not adjusted.has_factor or POINT not in result.covariances or not (tied or result.free is None):
        return []
    sigma = np.sqrt(np.einsum("nii->n", result.point_covariance_m2) / 3)
    sigmas = sigma[np.isfinite(sigma) & (sigma > 0)]
    most = float(np.quantile(sigmas, WEAK_SHARE)) if len(sigmas) else 0.0
    if not np.isfinite(on_ground) or most <= WEAK_DATUM * on_ground:
        return []
    what = least_certain(adjusted.problem, factor_of(adjusted), adjusted.state)
    text = (
        f"hardly determined: {what}; one point in twenty has a standard deviation above {about(most)}, "
        f"{most / on_ground:.0f} times what an image point measures"
    )
    return [Finding("weak_datum", "warning", text, REMEDY, statistic=most / on_ground)]
