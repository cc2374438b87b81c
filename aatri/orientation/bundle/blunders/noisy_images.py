"""An image whose points err by more than those of others, as a blurred one's; or all images of a strip.

Least squares share the errors of an image out among all that see its points. Where the scale of its residuals is
larger than that of its class by `SUSPICIOUS`, the largest of all, and more than chance allows one of all images, the
standard deviations of its points become `APART` times as large, in a class of its own: then its errors remain in its
own residuals, and these tell the scale. Where that is `NOISY` it stays, and where it is not all is as before. Where
`MOST_OF_STRIP` of the images of its strip are suspicious like it, and these are no more than half of all, they are one
class: another film, camera or scanner, from `NOISY_STRIP` on.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.statistics.class_scales import EFFICIENCY, class_scales, robust_scale
from aatri.adjustment.statistics.limits import ALARM, SILENT_REDUNDANCY
from aatri.arrays import Bool, Float, Int, Text
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.blunders.limits import (
    LEAST_REDUNDANCY_OF_IMAGE,
    MISNAMED,
    MOST_OF_BLOCK,
    MOST_OF_STRIP,
    NOISY,
    NOISY_STRIP,
    SUSPICIOUS,
)
from aatri.orientation.bundle.blunders.tested_block import residuals_beside
from aatri.orientation.bundle.result import BundleResult

ASKED = {
    NOISY: "is it blurred, or measured badly? measure it again",
    NOISY_STRIP: "is it of another film, camera or scanner? give its image points standard deviations of their own",
}
"""What a warning asks of an image, and of a strip."""


def is_of_images(o: Observed) -> bool:
    """Whether these are measured image points."""
    return o.is_measured and {POSE, POINT} <= {group for group, _ in o.records.touches}


def noisiest_images(
    result: BundleResult,
    least_squares: BundleResult | None,
    number: Sequence[Int],
    apart: Sequence[tuple[int, ...]],
    strip: Text | None = None,
) -> Int:
    """The image, or strip, whose points seem to err by more than those of their class, most of them, not by chance.

    Parameters
    ----------
    least_squares : BundleResult, optional
        The adjustment whose covariances are known, where `result` has none.
    number : sequence of (n, m) int
        Class of every component of each of the observations.
    apart : sequence of tuple of int
        Images that have classes of their own.
    strip : (n,) str, optional
        Of each image; empty without.
    """
    n_images = len(result.image_adjusted)
    parts: list[tuple[Float, Float, Int]] = [(np.zeros((0, 1)), np.zeros((0, 1)), np.zeros(0, dtype=np.int64))]
    redundancy, squares = np.zeros(n_images), np.zeros(n_images)
    for i, observations in enumerate(result.observations):
        o, rows = observations.observed, np.flatnonzero(observations.used)
        if is_of_images(o) and len(rows):
            v, r = residuals_beside(result, least_squares, i, rows)
            group, image = number[i][rows], dict(o.records.touches)[POSE][rows]
            of_classes = class_scales(v.ravel(), r.ravel(), group.ravel(), 1 + int(group.max(initial=0)))
            r = np.where(np.isfinite(v) & (r > SILENT_REDUNDANCY), r, 0.0)
            v = np.where(r > 0, v, 0.0) / of_classes.scale[group]
            redundancy += np.bincount(image, r.sum(axis=1), n_images)
            squares += np.bincount(image, np.einsum("nk,nk->n", v, v), n_images)
            parts.append((v, r, image))
    large = (squares > SUSPICIOUS**2 * redundancy) & (redundancy >= LEAST_REDUNDANCY_OF_IMAGE)
    is_apart = np.isin(np.arange(n_images), [k for images in apart for k in images])
    large &= ~is_apart
    v, r, image = (np.concatenate(values) for values in zip(*(_of_images(*part, large) for part in parts)))
    freedom = EFFICIENCY * np.maximum(redundancy, 1.0)
    by_chance = np.sqrt(chdtri(freedom, ALARM / max(n_images, 1)) / freedom)
    scale, order = np.zeros(n_images), np.argsort(image, kind="stable")
    last = np.cumsum(np.bincount(image, minlength=n_images))
    for k in np.flatnonzero(large).tolist():
        rows = order[last[k - 1] if k else 0 : last[k]]
        of_image = robust_scale(v[rows], r[rows])
        scale[k] = of_image if max(SUSPICIOUS, by_chance[k]) < of_image < MISNAMED else 0.0
    noisiest = np.argsort(-scale, kind="stable")[: int(scale.any())]
    if strip is None or not len(noisiest) or not strip[noisiest[0]]:
        return noisiest
    of_strip = np.flatnonzero((strip == strip[noisiest[0]]) & (redundancy > 0) & ~is_apart)
    most_images = MOST_OF_BLOCK * np.count_nonzero(redundancy)
    is_strip = (scale[of_strip] > 0).mean() >= MOST_OF_STRIP and len(of_strip) <= most_images
    return of_strip if is_strip else noisiest


def _of_images(v: Float, r: Float, image: Int, chosen: Bool) -> tuple[Float, Float, Int]:
    """Components of the chosen images that have a redundancy, and their images."""
    use = chosen[image][:, None] & (r > 0)
    return v[use], r[use], np.broadcast_to(image[:, None], r.shape)[use]
