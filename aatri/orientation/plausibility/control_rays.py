"""Rays from known positions to control points, and the angles between two of them of one image.

    in the image   between (x, y, -c)_i and (x, y, -c)_j
    in space       between X_i - X0 and X_j - X0

The misfit of a pair is |difference| / angle in the image, that of an image the median over its pairs, that of a block
the median over its images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int

LEAST_ANGLE_RAD = 0.01
FEWEST_PAIRS = 3
MOST_IMAGES = 300
MOST_CONTROL = 12
"""Of one image; images and points beyond these numbers add nothing."""


@dataclass(frozen=True)
class ControlRays:
    """Rays to control points.

    Attributes
    ----------
    image, point : (k,) int
        Rows of `position_m` and `control_m`.
    xy_mm : (k, 2) float64, mm
        From the principal point.
    principal_point_mm : (k, 2) float64, mm
        What has been subtracted.
    c_mm : (k,) float64, mm
    position_m : (n, 3) float64, m
    control_m : (m, 3) float64, m
        All of them known.
    """

    image: Int
    point: Int
    xy_mm: Float
    principal_point_mm: Float
    c_mm: Float
    position_m: Float
    control_m: Float


@dataclass(frozen=True)
class Pairs:
    """Pairs of rays of one image each."""

    image: Int
    first: Int
    second: Int


def pairs_of(rays: ControlRays) -> Pairs:
    """Pairs of the rays of each image, but for those to nearly the same place.

    Parameters
    ----------
    rays : ControlRays
    """
    order = np.argsort(rays.image, kind="stable")
    begin = np.unique(rays.image[order], return_index=True)[1]
    groups = [g[:: max(1, -(-len(g) // MOST_CONTROL))] for g in np.split(order, begin[1:])]
    groups = [g for g in groups if len(g) > 1]
    groups = groups[:: max(1, -(-len(groups) // MOST_IMAGES))]
    first = [g[i] for g in groups for i in range(len(g)) for _ in range(i + 1, len(g))]
    second = [g[j] for g in groups for i in range(len(g)) for j in range(i + 1, len(g))]
    pairs = Pairs(rays.image[first], np.array(first, np.int64), np.array(second, np.int64))
    seen = np.maximum(angle_between(*in_image(rays, pairs)), angle_between(*in_space(rays, pairs))) > LEAST_ANGLE_RAD
    return Pairs(pairs.image[seen], pairs.first[seen], pairs.second[seen])


def in_image(rays: ControlRays, pairs: Pairs) -> tuple[Float, Float]:
    """The two directions of each pair as measured, (n, 3) mm."""
    u = np.column_stack([rays.xy_mm, -rays.c_mm])
    return u[pairs.first], u[pairs.second]


def in_space(rays: ControlRays, pairs: Pairs) -> tuple[Float, Float]:
    """The two directions of each pair from position to control, (n, 3) m."""
    d = rays.control_m[rays.point] - rays.position_m[rays.image]
    return d[pairs.first], d[pairs.second]


def angle_between(a: Float, b: Float) -> Float:
    """Angles between directions, (n,) rad."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def misfit_of_images(rays: ControlRays, pairs: Pairs) -> Float:
    """Misfit of each image that has pairs, in their order."""
    off = misfit_of_pairs(rays, pairs)
    order = np.lexsort((off, pairs.image))
    _, begin, count = np.unique(pairs.image[order], return_index=True, return_counts=True)
    low, high = off[order][begin + (count - 1) // 2], off[order][begin + count // 2]
    return np.asarray((low + high) / 2)


def misfit_of_pairs(rays: ControlRays, pairs: Pairs) -> Float:
    """Difference of the angles of each pair, as a share of that in the image."""
    image = np.maximum(angle_between(*in_image(rays, pairs)), 1e-9)
    return np.asarray(np.abs(angle_between(*in_space(rays, pairs)) - image) / image)


def misfit(rays: ControlRays, pairs: Pairs) -> float:
    """Misfit of the block."""
    return float(np.median(misfit_of_images(rays, pairs)))
