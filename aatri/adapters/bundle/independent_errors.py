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

MOST_POINTS, MOST_WITH_TESTS = 5_000, 200_000
"""Beyond this the errors are many and the count not worth its time, or, where observations are tested, its memory."""


def independent_errors_table(block: Block, result: BundleResult, *, tests: bool) -> IndependentErrors | None:
    """Counts of the points that are no control and of the check points; None without their covariances.

    Held points have no errors, and are not counted. Whether a truth is known makes no difference: it changes nothing.

    Parameters
    ----------
    block : Block
    result : BundleResult
        In the frame of the adjustment.
    tests : bool
        Observations are tested too.
    """
    variance = np.einsum("nii->ni", result.covariances[POINT])
    known = np.isfinite(variance) & (variance > 0) & np.isfinite(result.xyz_m)
    adjusted = result.adjusted
    most = MOST_WITH_TESTS if tests else MOST_POINTS
    if not known.any() or len(known) > most or result.free is not None or adjusted.down_weighted:
        return None
    nothing = np.zeros_like(variance)
    counts: dict[str, Float] = {}
    ground = block.ground_points
    new = known.all(axis=1)
    new[ground.point[(ground.role == CONTROL).any(axis=1)]] = False
    if new.any():
        members = new[:, None] & np.ones(3, dtype=bool)
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
