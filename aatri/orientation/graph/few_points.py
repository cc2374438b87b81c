"""The similarity of two components by all rays between them, where few points are common to both.

A point of one component that an image of the other sees lies on that ray: two conditions. A point of both gives three.
The seven unknowns are estimated from these, as directions of rays:

    min  sum rho(e^2),   e the coordinates of  unit(X - C) - d,   rho(z) = 2 (sqrt(1 + z / WIDE_RAD^2) - 1)

with X a point of one component brought into the frame of the other, C and d centre and direction of a ray there, over
the rays that are within `START_RAD` at the start. Common points near a line leave the turn about it open, and two
objects may carry the number of one: starts are of all common points and of all but one, turned all round; that which
most conditions fit counts. What leaves one of the seven unknowns open, points on a line alone, joins nothing.

Common points that locate a wrong one are `FEWEST` (`joining`); as many conditions as these have must fit.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import UNKNOWNS, Similarity, compose, inverse, robust_closed_form, transform, updated
from aatri.geometry.vectors import unit
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.limits import FEWEST_COMMON, MOST_COMMON, WEAKEST_COMBINATION, WIDE_RAD

TURNS, START_RAD = 24, 0.15
"""Turns about the line of the common points that are tried; rays that far off take part: half a turn is 0.13."""

BY_RAY, BY_POINT = 2, 3
"""Conditions of a point that the other component sees once, and of one that it has determined itself."""


@dataclass(frozen=True)
class _Crossing:
    """Rays of the images of one component to points of another, each in its own frame."""

    rows: Int
    """(n,). Of the rays."""
    centre: Float
    direction: Float
    """(n, 3). Projection centres, and unit vectors along the rays."""
    xyz: Float
    """(n, 3). The points."""

    def off_rad(self, images_from_points: Similarity) -> Float:
        """Directions to the points less those of the rays, (n, 3), rad where they are small."""
        return np.asarray(unit(transform(images_from_points, self.xyz) - self.centre) - self.direction)


def by_few_points(
    base: ImageComponent, other: ImageComponent, rays: ImagePointRows, fewest: int, most_wrong: float
) -> tuple[Similarity, int] | None:
    """Base from other by the rays between them, and the points that fit; None where too few conditions do.

    Parameters
    ----------
    fewest : int
        Conditions that must fit.
    most_wrong : float
        Share of the conditions that may not fit.
    """
    common = finite_rows(base.xyz) & finite_rows(other.xyz)
    if common.sum() < FEWEST_COMMON:
        return None
    of_base, of_other = _to_unit_size(base.xyz[common]), _to_unit_size(other.xyz[common])
    if of_base is None or of_other is None:
        return None
    near, far = base.moved(of_base), other.moved(of_other)
    of_near, of_far = _crossing(near, far, rays), _crossing(far, near, rays)
    rows = np.concatenate([of_near.rows, of_far.rows])
    every = int(conditions(base, other, rays, rows).sum())
    if every < fewest:
        return None

    def off_rad(similarity: Similarity) -> Float:
        return np.concatenate([of_near.off_rad(similarity), of_far.off_rad(inverse(similarity))])

    def fitting(similarity: Similarity, limit_rad: float = WIDE_RAD) -> tuple[int, float]:
        """Conditions that fit, and how well."""
        share = np.linalg.norm(off_rad(similarity), axis=1) / limit_rad
        fits = conditions(base, other, rays, rows[share < 1.0])
        return int(fits.sum()), -float((np.minimum(share, 1.0) ** 2).sum())

    def adjusted(begun: Similarity, limit_rad: float = START_RAD) -> tuple[Similarity, Float]:
        """With the singular values of the design of the rays that take part."""
        taking_part = np.linalg.norm(off_rad(begun), axis=1) < limit_rad

        def residuals(dx: Float) -> Float:
            return np.asarray(off_rad(updated(begun, dx))[taking_part].ravel())

        if 2 * taking_part.sum() < UNKNOWNS:
            return begun, np.zeros(UNKNOWNS)
        solved = least_squares(residuals, np.zeros(UNKNOWNS), loss="soft_l1", f_scale=WIDE_RAD)
        return updated(begun, solved.x), np.linalg.svd(solved.jac, compute_uv=False)

    of_lines = _starts(far.xyz[common], near.xyz[common])
    starts = [max(turned, key=lambda similarity: fitting(similarity, START_RAD)) for turned in of_lines]
    best = max((adjusted(start)[0] for start in starts), key=fitting)
    best, effect = adjusted(best, WIDE_RAD)
    if fitting(best)[0] < max(fewest, (1.0 - most_wrong) * every) or effect[-1] < WEAKEST_COMBINATION * effect[0]:
        return None
    fits = conditions(base, other, rays, rows[np.linalg.norm(off_rad(best), axis=1) < WIDE_RAD])
    return compose(inverse(of_base), compose(best, of_other)), int((fits > 0).sum())


def _crossing(images: ImageComponent, points: ImageComponent, rays: ImagePointRows) -> _Crossing:
    """Rays of the images of one component to points of the other; of points of its own only those that fit."""
    crosses: Bool = rays.active & images.images[rays.image] & finite_rows(points.xyz)[rays.point]
    rows = np.flatnonzero(crosses & (images.kept | ~finite_rows(images.xyz)[rays.point]))
    direction = unit(rays.directions(images.poses, rows))
    return _Crossing(rows, images.poses.position_m[rays.image[rows]], direction, points.xyz[rays.point[rows]])


def conditions(base: ImageComponent, other: ImageComponent, rays: ImagePointRows, rows: Int) -> Int:
    """Conditions of two components by each point, (n_points,), of those of these rays that go between them."""
    counts = np.zeros((2, len(base.xyz)), dtype=int)
    has_coordinates = np.stack([finite_rows(points.xyz) for points in (other, base)])
    for side, images in enumerate((base, other)):
        between = rows[images.images[rays.image[rows]] & has_coordinates[side][rays.point[rows]]]
        counts[side] = np.bincount(rays.point[between], minlength=len(base.xyz))
    of_both = np.where((counts > 0).all(axis=0), BY_POINT, 0)
    return np.where(has_coordinates.all(axis=0), of_both, np.minimum(BY_RAY * counts.max(axis=0), BY_POINT))


def _to_unit_size(X: Float) -> Similarity | None:
    """To a frame with most of these points at a distance of about one from its origin; None where they coincide."""
    centre = np.median(X, axis=0)
    length = float(np.median(np.linalg.norm(X - centre, axis=1)))
    return Similarity(-centre / length, 1.0 / length, np.eye(3)) if length > 0 else None


def _starts(x: Float, X: Float) -> list[list[Similarity]]:
    """Similarities of all common points, and of all but one, which may be wrong; each turned about their line."""
    subsets = [np.ones(len(x), dtype=bool)]
    if FEWEST_COMMON < len(x) <= MOST_COMMON:
        subsets += list(~np.eye(len(x), dtype=bool))
    apart = [s for s in subsets if np.ptp(x[s], axis=0).any() and np.ptp(X[s], axis=0).any()]
    return [_turned(robust_closed_form(x[s], X[s])[0], X[s]) for s in apart]


def _turned(similarity: Similarity, X: Float) -> list[Similarity]:
    """The similarity, turned about the line along which these points lie."""
    centre = X.mean(axis=0)
    axis = np.linalg.svd(X - centre)[2][0]
    turns = [exp_rotation(angle_rad * axis) for angle_rad in 2.0 * np.pi / TURNS * np.arange(TURNS)]
    return [compose(Similarity(centre - R @ centre, 1.0, R), similarity) for R in turns]
