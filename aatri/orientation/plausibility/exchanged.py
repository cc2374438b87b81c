"""Control points whose numbers are exchanged: by angles between rays, or by where orientations put the points.

A point a is found where the rays of the oriented images that show it meet, p_a, and given as x_a. Numbers a and b are
exchanged if

    max(|p_a - x_b|, |p_b - x_a|) < share min(|p_a - x_a|, |p_b - x_b|).

Of rejected control, whose orientation is that of a robust adjustment, `share` is small. Of a start it is larger, and at
least a quarter of the control, and one point beside the two, must lie that much nearer to where it is given: else the
orientations are wrong and not the control. Errors of a start that all points have in common exchange nothing.

Without orientations, with positions alone, numbers a and b are exchanged if that reduces the misfit of the angles from
one of them to others (`control_rays`) to a share, and does so for no other pair. Two points that are each other's
mirror image keep their angles, and are not found.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.plausibility.control_rays import FEWEST_PAIRS, ControlRays, Pairs, misfit_of_pairs

SHARE_REJECTED, SHARE_AT_START = 0.05, 0.2
"""Two points are exchanged if that leaves this share of their distances: rejected ones, at the start."""

EXPLAINED, ALONE = 0.3, 2.0
"""Angles show two exchanged points if the misfit falls to this share, and that of any other two is so many times as
large."""

STANDS_OUT, LEAST_MISFIT = 3.0, 0.05
"""A point stands out by a misfit above this multiple of what a quarter of the points has, and above the latter."""

MOST_TRIED = 40
"""Where more points than these are off, it is no matter of two numbers."""


@dataclass(frozen=True)
class Exchanged:
    """Two points with each other's number.

    Attributes
    ----------
    first, second : int
    as_given_m, exchanged_m : float, m
        The smaller distance from where they are found as given, the larger with the numbers exchanged.
    """

    first: int
    second: int
    as_given_m: float
    exchanged_m: float


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
    if len(far) > MOST_TRIED:
        return []
    return exchanged_pairs(found_m, given_m, far.tolist(), SHARE_AT_START)


def apart(a: Float, b: Float) -> float:
    """Distance of two points in the coordinates both have, m; infinite if there are none."""
    both = np.isfinite(a) & np.isfinite(b)
    return float(np.linalg.norm(a[both] - b[both])) if both.any() else np.inf


@dataclass(frozen=True)
class ExchangedByAngles:
    """Two points with each other's number.

    Attributes
    ----------
    first, second : int
    as_given, exchanged : float
        Misfit of the angles from one of them to others.
    images : (j,) int
        The images that show it.
    """

    first: int
    second: int
    as_given: float
    exchanged: float
    images: Int


def exchanged_by_angles(rays: ControlRays, pairs: Pairs, limit: float) -> ExchangedByAngles | None:
    """The two points of which the angles show that their numbers are exchanged, if any do.

    All angles to an exchanged point but that to the other are off, so that both are among the points whose median is.

    Parameters
    ----------
    rays : ControlRays
    pairs : Pairs
    limit : float
        Misfit that is too large whatever the others have.
    """
    first, second = rays.point[pairs.first], rays.point[pairs.second]
    off = misfit_of_pairs(rays, pairs)
    points = np.union1d(first, second)
    of_point = np.array([np.median(off[(first == k) | (second == k)]) for k in points.tolist()])
    limit = min(limit, max(STANDS_OUT * float(np.quantile(of_point, 0.25)), LEAST_MISFIT))
    far = points[of_point > limit].tolist()
    tried = [_tried(rays, pairs, a, b) for a, b in combinations(far, 2)] if len(far) <= MOST_TRIED else []
    found = sorted((one for one in tried if one is not None), key=lambda one: one.exchanged)
    if not found or found[0].exchanged > min(EXPLAINED * found[0].as_given, limit):
        return None
    return found[0] if len(found) == 1 or found[1].exchanged > ALONE * found[0].exchanged else None


def _tried(rays: ControlRays, pairs: Pairs, a: int, b: int) -> ExchangedByAngles | None:
    """Two points exchanged; None where too few angles change."""
    first, second = rays.point[pairs.first], rays.point[pairs.second]
    touched = ((first == a) | (second == a)) != ((first == b) | (second == b))
    if touched.sum() < FEWEST_PAIRS:
        return None
    some = Pairs(pairs.image[touched], pairs.first[touched], pairs.second[touched])
    control = rays.control_m.copy()
    control[[a, b]] = control[[b, a]]
    as_given = float(np.median(misfit_of_pairs(rays, some)))
    exchanged = float(np.median(misfit_of_pairs(replace(rays, control_m=control), some)))
    return ExchangedByAngles(a, b, as_given, exchanged, np.unique(some.image))
