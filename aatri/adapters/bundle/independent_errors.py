"""How many independent errors the new points and the check points of a bundle have, axis by axis."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.covariance.independent import independent_errors
from aatri.arrays import Float
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import IndependentErrors
from aatri.observations.poses import POINT
from aatri.orientation.bundle.result import BundleResult

NEW_POINTS, CHECK_POINTS = "new", "check"

MOST_POINTS = 200_000
"""Beyond this the count is not worth its memory: the errors are many."""


def independent_errors_table(block: Block, result: BundleResult) -> IndependentErrors | None:
    """Counts for what is compared with the truth or with check points; None where there is neither, nor covariances.

    Held points have no errors, and are not counted.

    Parameters
    ----------
    block : Block
    result : BundleResult
        In the frame of the adjustment.
    """
    variance = np.einsum("nii->ni", result.covariances[POINT])
    known = np.isfinite(variance) & (variance > 0) & np.isfinite(result.xyz_m)
    adjusted = result.adjusted
    if not known.any() or len(known) > MOST_POINTS or result.free is not None or adjusted.down_weighted:
        return None
    nothing = np.zeros_like(variance)
    counts: dict[str, Float] = {}
    ground = block.ground_points
    if block.true_points is not None:
        new = np.zeros(len(known), dtype=bool)
        new[block.true_points.point] = True
        new[ground.point[(ground.role == CONTROL).any(axis=1)]] = False
        members = (new & known.all(axis=1))[:, None] & np.ones(3, dtype=bool)
        counts[NEW_POINTS] = independent_errors(adjusted, POINT, members, variance, nothing)
    check = np.zeros_like(known)
    check[ground.point] = ground.role == CHECK
    if check.any():
        given = nothing.copy()
        given[ground.point] = np.nan_to_num(np.einsum("nii->ni", ground.covariance_m2))
        counts[CHECK_POINTS] = independent_errors(adjusted, POINT, check & known, variance, given)
    if not counts:
        return None
    return IndependentErrors(points=np.array(list(counts)), count=np.array(list(counts.values())))
