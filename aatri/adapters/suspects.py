"""Image points with gross errors, as a robust bundle shows them: suspects for the least-squares bundle that follows.

The test statistic is the length of the residual in a-priori standard deviations. It is not standardised by a redundancy
number, which a robust adjustment does not have: the limit is to be generous, and the next bundle re-admits what fits.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters import solution as assemble
from aatri.artifacts.suspects import Suspects
from aatri.orientation.bundle.result import BundleResult


def with_gross_errors(result: BundleResult, suspects: Suspects, limit: float) -> Suspects:
    """The suspects and the image points whose residual is longer than `limit` standard deviations."""
    found = next(o for o in result.observations if o.observed.kind == "image_point")
    rows = np.flatnonzero(found.used)
    records = found.observed.records
    v, sigma = records.evaluate(result.adjusted.state, rows)[0], found.observed.sigmas()[rows]
    test = np.sqrt(np.nansum((v / sigma) ** 2, axis=1))
    far = np.flatnonzero(test > limit)
    rows, n = rows[far], len(far)
    size = np.sqrt(np.nansum(v[far] ** 2, axis=1))
    image, point = found.observed.names(rows)
    new = Suspects(
        kind=np.full(n, "image_point"),
        row=rows.astype(np.int32),
        image=image,
        point=point,
        stage=np.full(n, "bundle_adjustment"),
        size=size,
        unit=np.full(n, "mm"),
        sigma=size / test[far],
        test=test[far],
        verdict=np.full(n, "rejected"),
    )
    return assemble.stacked([suspects, new])
