"""The similarity of two components by all rays between them, where few points are common to both.

A point of one component that an image of the other sees lies on that ray: two conditions. A point of both gives three.
The seven unknowns are estimated from these, as directions of rays:

    min  sum rho(e^2),   e the coordinates of  unit(X - C) - d,   rho(z) = 2 (sqrt(1 + z / WIDE_RAD^2) - 1)

with X a point of one component brought into the frame of the other, C and d centre and direction of a ray there, over
the rays that are within `START_RAD` at the start. Common points near a line leave the turn about it open, and two
objects may carry the number of one: starts are of all common points and of all but one, turned all round; that which
most conditions fit counts.

Common points that locate a wrong one are `FEWEST` (`joining`); as many conditions as these have must fit.
"""

import numpy as np
from scipy.optimize import least_squares

from aatri.arrays import Float, Int, finite_rows
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import (
    UNKNOWNS,
    Similarity,
    compose,
    inverse,
    robust_closed_form,
    transform,
    updated,
)
from aatri.geometry.vectors import unit
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.graph.component import WIDE_RAD, ImageComponent

TURNS, START_RAD = 24, 0.15
"""Turns about the line of the common points that are tried; rays that far off take part: half a turn is 0.13."""

FEWEST_COMMON, MOST_COMMON = 2, 12
"""Common points that give a scale, and those of which each is left out once: of more one wrong turns no start."""

BY_RAY, BY_POINT = 2, 3
"""Conditions of a point that the other component sees once, and of one that it has determined itself."""


def by_few_points(
    base: ImageComponent, other: ImageComponent, rays: ImagePointRows, fewest: int, most_wrong: float
) -> Similarity | None:
    """Base from other by the rays between them; None where too few of their conditions fit.

    Parameters
    ----------
    fewest : int
        Conditions that must fit.
    most_wrong : float
        Share of the conditions that may not fit.
    """
    common = finite_rows(base.xyz) & finite_rows(other.xyz)
    rows = np.concatenate([_crossing(base, other, rays), _crossing(other, base, rays)])
    every = conditions(base, other, rays, rows)
    if common.sum() < FEWEST_COMMON or every < fewest:
        return None
    of_base, of_other = _of_unit_size(base.xyz[common]), _of_unit_size(other.xyz[common])
    near, far = base.moved(of_base), other.moved(of_other)

    def off_rad(similarity: Similarity) -> Float:
        return np.concatenate([_off_rad(near, far, similarity, rays), _off_rad(far, near, inverse(similarity), rays)])

    def adjusted(begun: Similarity) -> Similarity:
        taking_part = np.linalg.norm(off_rad(begun), axis=1) < START_RAD

        def residuals(dx: Float) -> Float:
            return np.asarray(off_rad(updated(begun, dx))[taking_part].ravel())

        if 2 * taking_part.sum() < UNKNOWNS:
            return begun
        return updated(begun, least_squares(residuals, np.zeros(UNKNOWNS), loss="soft_l1", f_scale=WIDE_RAD).x)

    def fitting(similarity: Similarity, limit_rad: float = WIDE_RAD) -> tuple[int, float]:
        """Conditions that fit, and how well."""
        share = np.linalg.norm(off_rad(similarity), axis=1) / limit_rad
        return conditions(base, other, rays, rows[share < 1.0]), -float((np.minimum(share, 1.0) ** 2).sum())

    turned = _starts(far.xyz[common], near.xyz[common])
    starts = [max(of_line, key=lambda similarity: fitting(similarity, START_RAD)) for of_line in turned]
    best = max(map(adjusted, starts), key=fitting)
    if fitting(best)[0] < max(fewest, (1.0 - most_wrong) * every):
        return None
    return compose(inverse(of_base), compose(best, of_other))


def _of_unit_size(X: Float) -> Similarity:
    """To a frame with most of these points at a distance of about one from its origin."""
    centre = np.median(X, axis=0)
    length = float(np.median(np.linalg.norm(X - centre, axis=1)))
    return Similarity(-centre / length, 1.0 / length, np.eye(3))


def _starts(x: Float, X: Float) -> list[list[Similarity]]:
    """Similarities of all common points, and of all but one, which may be wrong; each turned about their line."""
    subsets = [np.ones(len(x), dtype=bool)]
    if FEWEST_COMMON < len(x) <= MOST_COMMON:
        subsets += list(~np.eye(len(x), dtype=bool))
    return [_turned(robust_closed_form(x[s], X[s])[0], X[s]) for s in subsets]


def _turned(similarity: Similarity, X: Float) -> list[Similarity]:
    """The similarity, turned about the line along which these points lie."""
    centre = X.mean(axis=0)
    axis = np.linalg.svd(X - centre)[2][0]
    turns = [exp_rotation(angle_rad * axis) for angle_rad in 2.0 * np.pi / TURNS * np.arange(TURNS)]
    return [compose(Similarity(centre - R @ centre, 1.0, R), similarity) for R in turns]


def conditions(base: ImageComponent, other: ImageComponent, rays: ImagePointRows, rows: Int) -> int:
    """Conditions of two components by those of these rays that go from one to points of the other."""
    counts = np.zeros((2, len(base.xyz)), dtype=int)
    for side, (images, points) in enumerate(((base, other), (other, base))):
        crossing = rows[images.images[rays.image[rows]] & finite_rows(points.xyz)[rays.point[rows]]]
        counts[side] = np.bincount(rays.point[crossing], minlength=len(base.xyz))
    of_points = np.where((counts > 0).all(axis=0), BY_POINT, np.minimum(BY_RAY * counts.max(axis=0), BY_POINT))
    return int(of_points.sum())


def _crossing(images: ImageComponent, points: ImageComponent, rays: ImagePointRows) -> Int:
    """Rays of the images of one component to points of the other; of points of its own only those that fit."""
    crosses = rays.active & images.images[rays.image] & finite_rows(points.xyz)[rays.point]
    return np.flatnonzero(crosses & (images.kept | ~finite_rows(images.xyz)[rays.point]))


def _off_rad(
    images: ImageComponent, points: ImageComponent, images_from_points: Similarity, rays: ImagePointRows
) -> Float:
    """Directions to the points of the other component less those of the rays, (k, 3), rad where they are small."""
    rows = _crossing(images, points, rays)
    X = transform(images_from_points, points.xyz[rays.point[rows]])
    there = unit(X - images.poses.position_m[rays.image[rows]])
    return np.asarray(there - unit(rays.directions(images.poses, rows)))
