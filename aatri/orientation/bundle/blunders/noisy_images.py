"""An image whose points err by more than those of others, as a blurred one's.

Least squares share the errors of an image out among all that see its points. Where the scale of its residuals is
larger than that of its class by `SUSPICIOUS`, the largest of all, and more than chance allows one of all images, the
standard deviations of its points become `APART` times as large, in a class of its own: then its errors remain in its
own residuals, and these tell the scale. Where that is `NOISY` it stays, and where it is not all is as before.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.statistics.class_scales import EFFICIENCY, class_scales, robust_scale
from aatri.adjustment.statistics.limits import ALARM
from aatri.adjustment.statistics.variance_components import LEAST_SHARE
from aatri.arrays import Float, Int
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.blunders.tested_block import residuals_beside
from aatri.orientation.bundle.result import BundleResult

SUSPICIOUS = 1.5
"""Worth a trial: what least squares leave of an image's errors is less than these; the scale in the end decides."""

APART = 10.0
"""So much that the others no longer follow the image; what it is in the end its residuals tell."""

LEAST_REDUNDANCY = 5.0
"""Of an image, for a suspicion. Apart it has that of a resection, and counts if this is enough to tell a scale."""

NOISY = 1.6 / 0.6
"""Images of one flight are of unlike quality; errors of 0.6 to 1.6 times the usual ones are no fault of any
(`python -m tests.campaigns.false_alarms`), and an image that errs by less than the worst of them beside the best is
weighted like others."""

MISNAMED = 50.0
"""Points so much farther off have other points' numbers, or an image another's: errors of half a millimetre where 10 um
are usual."""


def is_of_images(o: Observed) -> bool:
    """Whether these are measured image points."""
    return o.is_measured and {POSE, POINT} <= {group for group, _ in o.records.touches}


def noisiest_image(
    result: BundleResult, least_squares: BundleResult | None, number: Sequence[Int], apart: Sequence[int]
) -> int | None:
    """The image whose points seem to err by more than those of its class, most of them, and not by chance.

    Parameters
    ----------
    least_squares : BundleResult, optional
        The adjustment whose covariances are known, where `result` has none.
    number : sequence of (n, m) int
        Class of every component of each of the observations.
    apart : sequence of int
        Images that have classes of their own.
    """
    parts: list[tuple[Float, Float, Int]] = [(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64))]
    for i, observations in enumerate(result.observations):
        o, rows = observations.observed, np.flatnonzero(observations.used)
        if is_of_images(o) and len(rows):
            v, r = residuals_beside(result, least_squares, i, rows)
            usable = np.isfinite(v) & (r > LEAST_SHARE)
            group = number[i][rows][usable]
            of_classes = class_scales(v[usable], r[usable], group, 1 + int(group.max(initial=0)))
            image = np.broadcast_to(dict(o.records.touches)[POSE][rows][:, None], v.shape)
            parts.append((v[usable] / of_classes.scale[group], r[usable], image[usable]))
    v, r, image = (np.concatenate(values) for values in zip(*parts))
    redundancy = np.bincount(image, r)
    large = np.bincount(image, v**2) > SUSPICIOUS**2 * redundancy
    large[[k for k in apart if k < len(large)]] = False
    freedom = EFFICIENCY * np.maximum(redundancy, 1.0)
    by_chance = np.sqrt(chdtri(freedom, ALARM / max(len(redundancy), 1)) / freedom)
    scale, order = np.zeros(len(redundancy)), np.argsort(image, kind="stable")
    last = np.cumsum(np.bincount(image))
    for k in np.flatnonzero(large & (redundancy >= LEAST_REDUNDANCY)).tolist():
        rows = order[last[k - 1] if k else 0 : last[k]]
        of_image = robust_scale(v[rows], r[rows])
        scale[k] = of_image if max(SUSPICIOUS, by_chance[k]) < of_image < MISNAMED else 0.0
    return int(np.argmax(scale)) if scale.any() else None
