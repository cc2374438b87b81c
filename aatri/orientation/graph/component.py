"""A component: images oriented to each other by a robust bundle without datum.

Image points only; seven scalars of the poses are held, which changes no residual. Points and rays are those that fit
(`triangulation`), at first widely, after the bundle by the spread that it leaves. Huber's loss throughout.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.problem import SolverSettings
from aatri.adjustment.unknowns import Ids
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity, transform
from aatri.ids import shown
from aatri.observations.image_point_rows import ImagePointRows, residuals_mm
from aatri.observations.image_points import observed_image_points
from aatri.observations.observed import named
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.limits import ALL_SIDES
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.settings import BundleSettings
from aatri.orientation.graph.limits import (
    FEWEST_POINTS,
    LEAST_FITTING,
    LEAST_SHOWN,
    LEAST_SPREAD,
    NARROW_RAD,
    TRIM_LIMIT,
    WIDE_RAD,
)
from aatri.orientation.graph.triangulation import intersected
from aatri.progress import SILENT, Reporter

HUBER = 2.0
"""Bound of Huber's loss: 99 % efficient for normal errors (Huber 1981, Robust statistics, 4.5)."""

MEDIAN_OF_TWO = 1.1774
"""Median of the length of two standard normal components: sqrt(2 ln 2)."""

ITERATIONS = 60

TOLERANCE, FINALLY = 1.0, 0.1
"""Of the bundles, and of the last of them: by how many standard deviations all unknowns together still move. A start
needs no more, and Huber's loss converges slowly."""


@dataclass(frozen=True, eq=False)  # its arrays have no truth value: components are the same or not
class ImageComponent:
    """Images in one free frame."""

    poses: Poses
    """NaN where the image is not in it."""
    xyz: Float
    """(n_points, 3). NaN where not determined."""
    kept: Bool
    """(n,). Rays that fit."""
    spread: float
    """Of the residuals, robust, in standard deviations a priori."""
    bends: tuple[tuple[Float, Float], ...] = ()
    """(n_images, 3) and (n_points, 3): by how much projection centres and points are off for each principal distance
    that is wrong by its standard deviation; see `principal_distance`."""

    @property
    def images(self) -> Bool:
        """Which images are in it."""
        return finite_rows(self.poses.position_m)

    @property
    def ray_spread(self) -> float:
        """Standard deviation of its rays over the one a priori; that of rays which fit exactly is no zero."""
        return max(self.spread, LEAST_SPREAD)

    def without_point(self, point: int, rays: ImagePointRows) -> ImageComponent:
        """The same where its images do not show a point."""
        xyz = self.xyz.copy()
        xyz[point] = np.nan
        return replace(self, xyz=xyz, kept=self.kept & (rays.point != point))

    def moved(self, to: Similarity) -> ImageComponent:
        """The same after a similarity."""
        poses = Poses(transform(to, self.poses.position_m), to.rotation @ self.poses.ground_from_image)
        bends = tuple((to.scale * a @ to.rotation.T, to.scale * b @ to.rotation.T) for a, b in self.bends)
        return replace(self, poses=poses, xyz=transform(to, self.xyz), bends=bends)


def component_of(body: FreeBody, rays: ImagePointRows) -> ImageComponent:
    """Images and points of a body, with the rays that fit it."""
    has = body.has
    rows = np.flatnonzero(rays.active & has[POSE][rays.image] & has[POINT][rays.point])
    fits = rows[residuals_mm(rays, rows, body.poses, body.xyz) <= WIDE_RAD * rays.c_mm[rows]]
    spread = _spread(rays, fits, body.poses, body.xyz)
    return ImageComponent(body.poses, body.xyz, np.isin(np.arange(len(rays.image)), fits), spread)


def adjusted_component(
    rays: ImagePointRows,
    images: Bool,
    rotation: Float,
    centre: Float,
    image_ids: Ids,
    point_ids: Ids,
    reporter: Reporter = SILENT,
) -> ImageComponent:
    """A component from its rotations and projection centres.

    Raises
    ------
    GeometryError, ConvergenceError
        If too little of it fits.
    """
    poses, limit_mm = Poses(centre, rotation).where(images), wide_mm(rays)
    try:
        return refined(rays, poses, image_ids, point_ids, (limit_mm, None), reporter)
    except ConvergenceError as error:  # an image that fits nowhere keeps the others from settling
        reporter.log(f"once more with the rays that fit better: {error.what}")
        return refined(rays, poses, image_ids, point_ids, (limit_mm * NARROW_RAD / WIDE_RAD, None), reporter)


def wide_mm(rays: ImagePointRows) -> float:
    """`WIDE_RAD` in images of the usual principal distance, mm."""
    return WIDE_RAD * float(np.median(rays.c_mm)) if len(rays.c_mm) else 0.0


def refined(
    rays: ImagePointRows,
    poses: Poses,
    image_ids: Ids,
    point_ids: Ids,
    limits_mm: tuple[float | None, ...],
    reporter: Reporter = SILENT,
) -> ImageComponent:
    """Points, trimming and bundle, once for every limit; None is that of the spread of the residuals.

    Raises
    ------
    GeometryError, ConvergenceError
    """
    spread, xyz = 1.0, np.full((len(point_ids), 3), np.nan)
    for number, limit_mm in enumerate(limits_mm, 1):
        limit = limit_mm or TRIM_LIMIT * max(spread, 1.0) * float(np.median(rays.sigma_mm))
        xyz, kept = intersected(rays, poses, limit, xyz)
        few = np.bincount(rays.image[kept], minlength=len(poses.position_m)) < FEWEST_POINTS
        poses, kept = poses.where(~few), kept & ~few[rays.image]
        if len(finite_rows(poses.position_m).nonzero()[0]) < 2:
            raise GeometryError("too few of their points fit", remedy="check the ids of images and points")
        xyz[np.bincount(rays.point[kept], minlength=len(xyz)) < 2] = np.nan
        tolerance = FINALLY if number == len(limits_mm) else TOLERANCE
        poses, xyz = _bundled(replace(rays, active=kept), poses, xyz, image_ids, point_ids, tolerance, reporter)
        rows = np.flatnonzero(kept & finite_rows(poses.position_m)[rays.image] & finite_rows(xyz)[rays.point])
        spread = _spread(rays, rows, poses, xyz)
    limit = TRIM_LIMIT * max(spread, 1.0) * float(np.median(rays.sigma_mm))
    adjusted = xyz
    xyz, kept = intersected(rays, poses, limit, adjusted)
    poses, dropped = _fitting(rays, poses, xyz, kept)
    if dropped:
        xyz, kept = intersected(rays, poses, limit, adjusted)
        xyz[np.bincount(rays.point[kept], minlength=len(xyz)) < 2] = np.nan
        kept &= finite_rows(xyz)[rays.point]
    return ImageComponent(poses, xyz, kept, spread)


def _spread(rays: ImagePointRows, rows: Int, poses: Poses, xyz: Float) -> float:
    """Standard deviations over those given: the median residual, whose share of the errors is the redundancy's."""
    off = residuals_mm(rays, rows, poses, xyz) / rays.sigma_mm[rows].mean(axis=1)
    unknowns = 6 * len(np.unique(rays.image[rows])) + 3 * len(np.unique(rays.point[rows])) - 7
    share = max(1.0 - unknowns / max(2 * len(rows), 1), LEAST_SHOWN)
    return float(np.median(off) / MEDIAN_OF_TWO / np.sqrt(share)) if len(rows) else 1.0


def _fitting(rays: ImagePointRows, poses: Poses, xyz: Float, kept: Bool) -> tuple[Poses, int]:
    """Without images most of whose points do not fit, as of a mirrored image; and how many they are."""
    n = len(poses.position_m)
    visible = rays.active & finite_rows(xyz)[rays.point] & finite_rows(poses.position_m)[rays.image]
    total, fitting_count = (np.bincount(rays.image[rows], minlength=n) for rows in (visible, kept))
    lost = fitting_count < LEAST_FITTING * total
    return poses.where(~lost), int(lost.sum())


def _bundled(
    rays: ImagePointRows,
    poses: Poses,
    xyz: Float,
    image_ids: Ids,
    point_ids: Ids,
    tolerance: float,
    reporter: Reporter,
) -> tuple[Poses, Float]:
    ids, points = np.asarray(image_ids, dtype=np.str_), np.asarray(point_ids, dtype=np.str_)
    names = named(image=ids[rays.image], point=points[rays.point])
    inputs = BundleInput(
        image_ids, point_ids, observed_image_points(rays, (), names), poses, xyz[: len(points)], np.zeros(3), rays
    )
    settings = BundleSettings(
        "minimal",
        covariances=False,
        huber=HUBER,
        solution=SolverSettings(max_iterations=ITERATIONS, tolerance=tolerance),
    )
    result = adjust_bundle(inputs, settings, reporter=reporter)
    lost = finite_rows(poses.position_m) & ~result.image_adjusted
    if lost.any():
        reporter.log(f"not held by the points that fit: {shown(ids[lost])}")
    return result.poses, result.xyz_m


def first_base_one(component: ImageComponent) -> tuple[ImageComponent, Similarity]:
    """A component without a datum in its own frame, and the similarity that led there.

    The first base is 1, the images look down where they do so in the mean. The origin is the first image's projection
    centre, the second image the next one in the order of ids. Images that look to all sides, as in an orbit, have no
    mean direction: then the axes are those of the first image.
    """
    rows = np.flatnonzero(component.images)
    centre, rotation = component.poses.position_m[rows], component.poses.ground_from_image[rows]
    base = np.linalg.norm(centre - centre[0], axis=1)
    apart = base > 1e-6 * base.max()
    scale = 1.0 / float(base[np.argmax(apart)])
    up = rotation[:, :, 2].mean(axis=0)
    turn = rotation[0].T
    if np.linalg.norm(up) > ALL_SIDES:
        turn = levelling(turn @ up) @ turn
    similarity = Similarity(-scale * turn @ centre[0], scale, turn)
    return component.moved(similarity), similarity
