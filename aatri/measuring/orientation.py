"""Where a point must be in every image, by a run: its orientations, cameras and corrections, all with covariances.

    v(X, m) = computed from X - reduced from the measurement m          as the adjustment of the run has it
    place:   m with v(X, m) = 0,    C = C_X projected + C_pose projected
    click:   d = m - place by the other clicks (and control),   t^2 = d' (C + C_click)^-1 d,   chi-square with 2

X is met by the clicks of this point, two or more, with its control coordinates as further observations; else it is the
control point, the point of the run, or lies on the ray of the one click as far away as the points of its image are.
Poses have their covariances within the block, of each other they are taken as independent. A click that the run has
used already fits its poses a little too well.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from aatri.adapters.frame.adjustment_frame import frame_of, points_into, solution_into
from aatri.adapters.interior.photo_coordinates import half_format_of
from aatri.adjusting.uncertain_intersection import intersect_uncertain
from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.geometry.collinearity import collinearity, in_image_axes, project
from aatri.measuring.measured_rays import SETTLED_MM, STEPS, MeasuredRays
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses

MARGIN = 1.2
"""Points are looked for in an image up to this multiple of its format."""
CHUNK, LOOSE = 100_000, 1e10
"""Rays that are taken at once; condition from which points do not hold an image."""
SIGMA_OF_EXACT_M = 1e-5
"""Standard deviation that exact control gets in the adjustment of an image while it is measured."""


@dataclass(frozen=True)
class Click:
    """A point measured in an image, in the coordinates of the tables."""

    image: str
    xy: Float
    sigma_mm: Float


@dataclass(frozen=True)
class PlaceInImage:
    """Where a point must be in an image, in the coordinates of the tables."""

    xy: Float
    """(2,)."""
    covariance: Float
    """(2, 2). NaN where the run tells no standard deviations."""
    off: Float | None = None
    """(2,). The click minus the place by the other clicks; None without a click, or without others."""
    t: float | None = None
    wrong: bool = False


@dataclass(frozen=True)
class GroundEstimate:
    """A point as far as something tells of it."""

    xyz_m: Float
    covariance_m2: Float


class RunOrientation:
    """The orientations of a run."""

    def __init__(self, block: Block, image_points: ImagePoints, solution: Solution) -> None:
        self.block, self.solution = block, solution
        self.row = {str(name): k for k, name in enumerate(block.images.id)}
        self.frame = frame_of(block)
        poses, self.xyz_m = solution_into(self.frame, solution)
        self.position_m, self.ground_from_image = poses.position_m, poses.ground_from_image
        self.oriented = finite_rows(self.position_m)
        self.point_row = {str(name): k for k, name in enumerate(solution.points.id)}
        self.rays = MeasuredRays(block, image_points, solution)
        self.c_mm = self.rays.c_mm
        self.covariance = self._within_block(image_points)

    def places(self, name: str, clicks: list[Click], control: GroundEstimate | None) -> dict[str, PlaceInImage]:
        """Where a point must be, by image; what is seen of the other clicks at each.

        Parameters
        ----------
        name : str
            Of the point.
        clicks : list of Click
            Of this point; those in images that are not oriented do not count.
        control : optional
            Its coordinates, NaN where not given, and their covariance, in the frame of the block.
        """
        clicks = [c for c in clicks if self.oriented[self.row.get(c.image, -1)] and c.image in self.row]
        image = np.array([self.row[c.image] for c in clicks], dtype=np.int64)
        xy = np.array([c.xy for c in clicks], float).reshape(-1, 2)
        sigma_mm = np.array([c.sigma_mm for c in clicks], float).reshape(-1, 2)
        ideal = self.rays.ideal_mm(image, self.rays.reduced_mm(image, xy))
        clicked, without, parallax = self._intersected(image, ideal, sigma_mm)
        best = _joined(clicked, control) or self._of_run(name) or self._on_ray(image, ideal, sigma_mm)
        if best is None:
            return {}
        shown = self._seen(best)
        for k, click in enumerate(clicks):
            others = _joined(without[k], control)
            there = self._seen(others or best, image[k : k + 1]).get(click.image)
            if there is None or (others is None and parallax is None):
                continue
            off = click.xy - there.xy
            t, limit = parallax, 1.0
            if others is not None:
                A = self.rays.table_from_mm(image[k])
                C = there.covariance + A @ np.diag(sigma_mm[k] ** 2) @ A.T
                t, limit = float(np.sqrt(off @ np.linalg.solve(C, off))), 2.0
            time = None if t is None or not np.isfinite(t) else t
            shown[click.image] = replace(
                there, off=off, t=time, wrong=time is not None and bool(chi2.sf(time**2, limit) < ALARM)
            )
        return shown

    def _within_block(self, image_points: ImagePoints) -> Float:
        """Covariances (n, 6, 6) of poses in the field of the points that they see, without what all share.

        Those of a run are absolute: without control they have the error of the datum, which moves images and points
        alike. A resection in the points of the run has it not, Q = (sum A' A / s^2)^-1, where a point met by n rays
        errs itself, s^2 = sigma^2 n / (n - 1). Images with too few points keep the covariance of the run.
        """
        m, n_images = image_points.measurements, len(self.block.images)
        rows = np.flatnonzero(
            m.active & self.oriented[m.image] & finite_rows(self.xyz_m[m.point]) & finite_rows(m.xy_mm)
        )
        n = np.bincount(m.point[rows], minlength=len(self.block.points))
        rows = rows[n[m.point[rows]] > 1]
        N = np.zeros((n_images, 6, 6))
        for first in range(0, len(rows), CHUNK):
            chunk = rows[first : first + CHUNK]
            i, p = m.image[chunk], m.point[chunk]
            A = collinearity(self.position_m[i], self.ground_from_image[i], self.xyz_m[p], self.c_mm[i])[1]
            A = A / m.sigma_mm[chunk][:, :, None] * np.sqrt(1.0 - 1.0 / n[p])[:, None, None]
            np.add.at(N, i, A.swapaxes(1, 2) @ A)
        Q = self.solution.images.covariance.copy()
        scale = np.sqrt(np.maximum(np.einsum("nii->ni", N), 1e-300))
        firm = np.linalg.cond(N / scale[:, :, None] / scale[:, None, :]) < LOOSE
        Q[firm] = np.linalg.inv(N[firm])
        return Q

    def control(self, xyz_m: Float, covariance_m2: Float, crs: str) -> GroundEstimate | None:
        """Coordinates of a control point of the folder; None where its frame is not that of the run."""
        if crs != str(self.block.frames.crs[0]):
            return None
        xyz = points_into(self.frame, xyz_m[None])[0]
        near = finite_rows(self.xyz_m) & np.isfinite(self.solution.points.covariance_m2).all(axis=(1, 2))
        if near.any():  # how far the block itself may be off there
            off = np.nan_to_num(self.xyz_m[near] - xyz)
            covariance_m2 = covariance_m2 + self.solution.points.covariance_m2[near][np.argmin((off**2).sum(axis=1))]
        return GroundEstimate(xyz, covariance_m2)

    def _axes(self, image: Int, xyz_m: Float) -> Float:
        return in_image_axes(self.position_m[image], self.ground_from_image[image], xyz_m)

    def residuals_mm(self, image: Int, xyz_m: Float, xy: Float) -> Float:
        """Computed minus observed, (n, 2), of points in the frame of the adjustment and measured coordinates."""
        return self.rays.misfit_mm(image, self._axes(image, xyz_m), self.rays.reduced_mm(image, xy))

    def _seen(self, ground: GroundEstimate, images: Int | None = None) -> dict[str, PlaceInImage]:
        """Places of a point in images, by default all that may see it."""
        image = np.flatnonzero(self.oriented & (self.rays.interior >= 0)) if images is None else images
        X = np.broadcast_to(ground.xyz_m, (len(image), 3))
        u = self._axes(image, X)
        camera = self.block.images.camera[image]
        half = half_format_of(self.block)[camera]
        with np.errstate(divide="ignore", invalid="ignore"):
            near = (u[:, 2] < 0) & ~(np.abs(project(u, self.c_mm[image])) > MARGIN * half).any(axis=1)
        image, X, u = image[near], X[near], u[near]
        if not len(image):
            return {}
        A = np.stack([self.rays.table_from_mm(k) for k in image.tolist()])
        matrix = self.rays.matrix_of(image)
        start = project(u, self.c_mm[image]) + self.solution.cameras.principal_point_mm[camera[near]] - matrix[:, :, 2]
        xy = np.einsum("nij,nj->ni", A, start)
        for _ in range(STEPS):
            v = self.rays.misfit_mm(image, u, self.rays.reduced_mm(image, xy))
            xy = xy + np.einsum("nij,nj->ni", A, v)
            if np.nanmax(np.abs(v), initial=0.0) < SETTLED_MM:
                break
        _, by_pose, by_point = collinearity(self.position_m[image], self.ground_from_image[image], X, self.c_mm[image])
        C = by_pose @ self.covariance[image] @ by_pose.swapaxes(1, 2)
        C = A @ (C + by_point @ ground.covariance_m2 @ by_point.swapaxes(1, 2)) @ A.swapaxes(1, 2)
        settled = np.abs(v).max(axis=1) < 1e3 * SETTLED_MM
        return {
            str(self.block.images.id[i]): PlaceInImage(xy[k], C[k]) for k, i in enumerate(image.tolist()) if settled[k]
        }

    def _intersected(
        self, image: Int, ideal: Float, sigma_mm: Float
    ) -> tuple[GroundEstimate | None, list[GroundEstimate | None], float | None]:
        """The point by all clicks, by all but each, and of two clicks how far their rays pass each other by."""
        n = len(image)
        if n < 2:
            return None, [None] * n, None
        pair = np.repeat(np.arange(n + 1), n)
        ray = np.tile(np.arange(n), n + 1)
        used = pair != ray + 1
        Q = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        c_mm, at_centre = self.c_mm[image[ray]], np.zeros((len(ray), 2))
        rays = ImagePointRows(image[ray], pair, ideal[ray], sigma_mm[ray], c_mm, at_centre, used)
        met = intersect_uncertain(rays, Poses(self.position_m, self.ground_from_image), Q, n + 1)
        met_at = finite_rows(met.xyz_m)
        points = [GroundEstimate(met.xyz_m[k], met.covariance_m2[k]) if met_at[k] else None for k in range(n + 1)]
        passing = met.whitened[:n]
        parallax = float(np.sqrt((passing**2).sum())) if n == 2 and met_at[0] else None
        return points[0], points[1:], parallax

    def _of_run(self, name: str) -> GroundEstimate | None:
        """A point of the run, with the covariance that its own rays give it within the block."""
        k, m = self.point_row.get(name, -1), self.block.image_points
        if k < 0 or not np.isfinite(self.xyz_m[k]).all():
            return None
        rows = np.flatnonzero((m.point == k) & m.active & self.oriented[m.image])
        i, X = m.image[rows], np.broadcast_to(self.xyz_m[k], (len(rows), 3))
        _, A, J = collinearity(self.position_m[i], self.ground_from_image[i], X, self.c_mm[i])
        C = A @ self.covariance[i] @ A.swapaxes(1, 2) + (m.sigma_mm[rows] ** 2)[:, :, None] * np.eye(2)
        N = (J.swapaxes(1, 2) @ np.linalg.solve(C, J)).sum(axis=0)
        singular = len(rows) < 2 or not np.isfinite(N).all()
        return GroundEstimate(self.xyz_m[k], self.solution.points.covariance_m2[k] if singular else np.linalg.inv(N))

    def _on_ray(self, image: Int, ideal: Float, sigma_mm: Float) -> GroundEstimate | None:
        """On the ray of the one click, as far from its image as the points are that it sees."""
        measured = self.block.image_points
        if not len(image):
            return None
        i = int(image[0])
        seen = measured.point[(measured.image == i) & finite_rows(self.xyz_m[measured.point])]
        if not len(seen):
            return None
        depth = -self._axes(np.full(len(seen), i), self.xyz_m[seen])[:, 2]
        middle = float(np.median(depth))
        spread = 1.4826 * float(np.median(np.abs(depth - middle))) + 0.01 * middle
        c = self.c_mm[i]
        ray = self.ground_from_image[i] @ np.append(ideal[0], -c) / c
        across = float(sigma_mm[0].max()) * middle / c
        C = spread**2 * np.outer(ray, ray) + across**2 * np.eye(3)
        return GroundEstimate(self.position_m[i] + middle * ray, C)


def _joined(clicked: GroundEstimate | None, control: GroundEstimate | None) -> GroundEstimate | None:
    """A point by its clicks and its control coordinates; None where neither tells it whole."""
    if control is None or not np.isfinite(control.xyz_m).any():
        return clicked
    controlled = np.isfinite(control.xyz_m)
    P, value = np.zeros((3, 3)), np.where(controlled, control.xyz_m, 0.0)
    block = np.ix_(controlled, controlled)
    P[block] = np.linalg.inv(control.covariance_m2[block] + SIGMA_OF_EXACT_M**2 * np.eye(int(controlled.sum())))
    N, right = P, P @ value
    if clicked is not None:
        own = np.linalg.inv(clicked.covariance_m2)
        N, right = N + own, right + own @ clicked.xyz_m
    elif not controlled.all():
        return None
    return GroundEstimate(np.asarray(np.linalg.solve(N, right), np.float64), np.asarray(np.linalg.inv(N), np.float64))
