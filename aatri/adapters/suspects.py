"""Image points with gross errors, as a robust bundle shows them: suspects for the least-squares bundle that follows.

The test statistic is the length of the residual in a-priori standard deviations. It is not standardised by a redundancy
number, which a robust adjustment does not have: the limit is to be generous, and the next bundle re-admits what fits.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters import solution as assemble
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.orientation.bundle.adjust import BundleResult
from aatri.orientation.bundle.block import BundleInput


def with_gross_errors(
    block: Block, given: BundleInput, result: BundleResult, suspects: Suspects, limit: float
) -> Suspects:
    """The suspects and the image points whose residual is longer than `limit` standard deviations."""
    records = next(r for r in result.adjusted.problem.records if r.name == "image point")
    used = np.flatnonzero(result.ray_used)
    v, sigma = records.residuals(result.adjusted.state), given.rays.sigma_mm[used]
    test = np.sqrt(np.nansum((v / sigma) ** 2, axis=1))
    far = np.flatnonzero((test > limit) & given.rays.active[used])
    rows, n = used[far], len(far)
    size = np.sqrt(np.nansum(v[far] ** 2, axis=1))
    found = Suspects(
        kind=np.full(n, "image_point"),
        row=rows.astype(np.int32),
        image=block.images.id[given.rays.image[rows]],
        point=block.points.id[given.rays.point[rows]],
        stage=np.full(n, "bundle_adjustment"),
        size=size,
        unit=np.full(n, "mm"),
        sigma=size / test[far],
        test=test[far],
        verdict=np.full(n, "rejected"),
    )
    return assemble.stacked([suspects, found])
