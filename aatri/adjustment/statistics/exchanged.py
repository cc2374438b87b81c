"""Points with each other's number: each is found at the coordinates of the other.

A point a is found where the rays of the oriented images that show it meet, p_a, and given as x_a. Numbers a and b are
exchanged if

    max(|p_a - x_b|, |p_b - x_a|) < share min(|p_a - x_a|, |p_b - x_b|).

Of rejected control, whose orientation is that of a robust adjustment, `share` is small. Of a start it is larger, and at
least a quarter of the control, and one point beside the two, must lie that much nearer to where it is given: else the
orientations are wrong and not the control. Errors of a start that all points have in common exchange nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.limits import MOST_FOR_EXCHANGE, SHARE_AT_START, SHARE_REJECTED
from aatri.arrays import Float


@dataclass(frozen=True)
class Exchanged:
    """Two points with each other's number."""

    first: int
    second: int
    as_given_m: float
    exchanged_m: float
    """The smaller distance from where they are found as given, the larger with the numbers exchanged."""


def exchanged_pairs(
    found_m: Float, given_m: Float, rows: Iterable[int], share: float = SHARE_REJECTED
) -> list[Exchanged]:
    """Pairs of points that fit with their numbers exchanged.

    Parameters
    ----------
    found_m, given_m : (n, 3) float64, m
        Where the images put each point, and where it is given; NaN not known.
    rows : iterable of int
        Which points are tried.
    share : float
        Of the distances as given, for those exchanged.
    """
    rows, pairs = list(rows), []
    for i, a in enumerate(rows):
        for b in rows[i + 1 :]:
            as_given = min(apart(found_m[a], given_m[a]), apart(found_m[b], given_m[b]))
            exchanged = max(apart(found_m[a], given_m[b]), apart(found_m[b], given_m[a]))
            if exchanged < share * as_given:
                pairs.append(Exchanged(a, b, as_given, exchanged))
    return pairs


def exchanged_at_start(found_m: Float, given_m: Float) -> list[Exchanged]:
    """Pairs of control points that fit with their numbers exchanged, where a start finds the others as they are given.

    Parameters
    ----------
    found_m, given_m : (n, 3) float64, m
        Where the images put each point, and where it is given; NaN not known.
    """
    off = np.array([apart(a, b) for a, b in zip(found_m, given_m)])
    judged = np.flatnonzero(np.isfinite(off))
    if len(judged) < 3:
        return []
    usual = float(np.quantile(off[judged], 0.25, method="lower"))
    far = judged[off[judged] > usual / SHARE_AT_START]
    if len(far) > MOST_FOR_EXCHANGE:
        return []
    return exchanged_pairs(found_m, given_m, far.tolist(), SHARE_AT_START)


def apart(a: Float, b: Float) -> float:
    """Distance of two points in the coordinates both have, m; infinite if there are none."""
    both = np.isfinite(a) & np.isfinite(b)
    return float(np.linalg.norm(a[both] - b[both])) if both.any() else np.inf
