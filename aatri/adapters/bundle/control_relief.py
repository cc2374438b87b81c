"""Relief of control that is larger or smaller than the images see it: heights in feet, downwards, or another lens.

    Z = m + (1 + p) (Z_given - m),     v = Z_adjusted - Z

m is the mean of the heights given. The score test of p (`adjustment.covariance.score`) says by how much the heights
would have to be stretched to fit the images; a principal distance wrong by the inverse does the same. Where orientation
goes by strips or pairs, `free_block.height_factor` finds it before; a bundle that starts from given orientations does
not pass there, and smears it over sigma0 and a few rejected points.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.covariance.score import score
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.poses import POINT
from aatri.orientation.bundle.result import BundleResult

SIGNIFICANT = 5.0
"""Standard deviations, a posteriori where sigma0 is above 1."""

LEAST = 0.02
FEWEST = 6
"""Heights: three tilt and shift the block, and some must be left to contradict."""


def relief_notes(result: BundleResult) -> list[Note]:
    """A warning where the relief of control does not fit the images.

    Parameters
    ----------
    result : BundleResult
        With covariances.
    """
    adjusted = result.adjusted
    found = next((o for o in result.observations if o.observed.kind == CONTROL and not o.observed.exact), None)
    if found is None or not adjusted.has_factor or adjusted.down_weighted or result.free is not None:
        return []
    records, rows = found.observed.records, np.flatnonzero(found.used)
    if records.rows != 3 or [group for group, _ in records.touches] != [POINT]:
        return []
    rows = rows[records.observed_components()[rows, 2]]
    if len(rows) < FEWEST or not np.isfinite(found.covariance[rows]).any():
        return []
    v = records.evaluate(adjusted.state, rows)[0][:, 2]
    given = adjusted.state[POINT][records.touches[0][1][rows], 2] - v
    derivative = np.zeros((len(rows), 3, 1))
    derivative[:, 2, 0] = given.mean() - given
    tried = score(adjusted, records, rows, derivative)
    stretched, sigma = 1.0 + float(tried.value[0]), float(tried.sigma[0]) * max(1.0, adjusted.sigma0)
    if abs(stretched - 1) < max(LEAST, SIGNIFICANT * sigma):
        return []
    text = (
        f"heights of {len(rows)} control points fit the images with {stretched:.3g} (+- {sigma:.2g}) times their "
        "relief: are they in feet (0.305), do they count downwards or are two axes exchanged (-1), or is the "
        "principal distance wrong?"
    )
    return [Note("warning", text)]
