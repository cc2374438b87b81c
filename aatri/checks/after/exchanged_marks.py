"""Film images with each other's image points, beside marks of their own.

The marks of image b transform the image points of a as if these had been measured on the film of b. With o_ab the
median distance of a's points from a resection by the marks of b, and f_a = 2 n_a - 6,

    T = f_a (o_aa^2 / o_ab^2 - 1) + f_b (o_bb^2 / o_ba^2 - 1)

is twice the logarithm of the likelihood ratio of two hypotheses without unknowns of their own, by the errors that the
exchange leaves; where nothing is exchanged it exceeds 2 ln k with a probability of 1 / k at most, if the errors of the
orientations are random. They are those adjusted: a wrong control point bends a start, and what it bends may look like
marks of another film. Where the adjustment fails those of its start are all there is.

Seen: two film images whose points do not fit by the marks of the same image.
Test: T of each pair of the worst images, at 1e-4 for all of them, and each of the two better by the marks of the other.
Points are those that other images intersect: all others, or where images are far off, all that are not.
Source: Neyman and Pearson 1933; Wald 1947 (bound of a likelihood ratio).
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.imported import read_at
from aatri.adapters.interior.photo_coordinates import measured_to_photo
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.checks.finding import Finding
from aatri.checks.limits import FAR_OFF, FEWEST_FITTING, MISFIT, MOST_MISFITS, NOT_EXCHANGED
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.vectors import finite_rows, unit
from aatri.observations.poses import Poses
from aatri.orientation.resection.adjustment import resect_images
from aatri.orientation.resection.start import start_orientation


@dataclass(frozen=True)
class _Oriented:
    """What images show of points, both with coordinates."""

    block: Block
    image_points: ImagePoints
    poses: Poses
    xyz_m: Float

    def rays(self, image: int) -> Int:
        """Rows of the measurements of an image."""
        m = self.image_points.measurements
        rows = np.flatnonzero((m.image == image) & m.active)
        return rows[finite_rows(self.xyz_m[m.point[rows]]) & finite_rows(m.xy_mm[rows])]

    def worst(self, films: list[int]) -> tuple[list[int], list[int]]:
        """Images that are far off what they see, each resected, and those that fit worst."""
        m, c_mm = self.image_points.measurements, self.block.cameras.principal_distance_mm[self.block.images.camera]
        rows = np.flatnonzero(m.active & np.isin(m.image, films))
        rows = rows[np.argsort(m.image[rows], kind="stable")]
        X0, R = self.poses.position_m, self.poses.ground_from_image
        fit = resect_images(m.xy_mm[rows], m.sigma_mm[rows], m.image[rows], m.point[rows], c_mm, self.xyz_m, X0, R)
        of_image = m.image[rows]
        placed = fit.position_m[of_image], fit.ground_from_image[of_image]
        off = _off(m.xy_mm[rows], c_mm[of_image], self.xyz_m[m.point[rows]], *placed)
        off_of = np.split(off, np.cumsum(np.bincount(of_image, minlength=len(c_mm)))[:-1])
        median_mm = np.array([np.nanmedian(off_of[k]) if fit.resected[k] else np.inf for k in films])
        usual = float(np.quantile(median_mm, 0.25, method="lower"))
        order = np.argsort(-median_mm, kind="stable")[:MOST_MISFITS]
        far, worst = ([films[k] for k in order.tolist() if median_mm[k] > times * usual] for times in (FAR_OFF, MISFIT))
        return far, worst

    def without(self, images: list[int]) -> "_Oriented":
        """With the points that the other images intersect."""
        m, cameras = self.image_points.measurements, self.block.cameras
        used = m.active & finite_rows(m.xy_mm) & self.poses.oriented[m.image] & ~np.isin(m.image, images)
        image = m.image[used]
        c_mm = cameras.principal_distance_mm[self.block.images.camera[image]]
        in_image = np.column_stack([m.xy_mm[used], -c_mm])
        direction = unit(np.einsum("nij,nj->ni", self.poses.ground_from_image[image], in_image))
        xyz_m = intersect_rays(self.poses.position_m[image], direction, m.point[used], len(self.xyz_m))
        return replace(self, xyz_m=xyz_m)

    def off_mm(self, image: int, marks_of: int) -> tuple[float, int]:
        """By how much the image's points are off a resection by the marks of an image, their median in mm, and f."""
        m, rows = self.image_points.measurements, self.rays(image)
        c_mm = float(self.block.cameras.principal_distance_mm[self.block.images.camera[image]])
        xy, xyz = m.xy_mm[rows] + self._moved(rows, image, marks_of), self.xyz_m[m.point[rows]]
        offered = (self.poses.position_m[image], self.poses.ground_from_image[image])
        freedom = 2 * len(rows) - 6
        if len(rows) < FEWEST_FITTING or (start := start_orientation(xy, c_mm, xyz, offered=offered)) is None:
            return np.inf, freedom
        of_one, point = np.zeros(len(rows), np.int64), np.arange(len(rows))
        fit = resect_images(xy, m.sigma_mm[rows], of_one, point, np.array([c_mm]), xyz, start[0][None], start[1][None])
        return float(np.median(_off(xy, c_mm, xyz, fit.position_m, fit.ground_from_image))), freedom

    def _moved(self, rows: Int, image: int, marks_of: int) -> Float:
        """What photo coordinates change where the marks of another image transform them, (n, 2), mm."""
        interior, uv = self.image_points.interior, self.block.image_points.xy[rows]
        of_own, of_other = (
            measured_to_photo(interior, np.full(len(rows), np.flatnonzero(interior.image == k)[0]), uv)
            for k in (image, marks_of)
        )
        return np.asarray(of_other - of_own)


def exchanged_marks(block: Block, image_points: ImagePoints | None, poses: Poses, xyz_m: Float) -> list[Finding]:
    """Pairs of film images whose points fit by the marks of the other.

    Parameters
    ----------
    block : Block
    image_points : ImagePoints, optional
    poses : Poses
        As adjusted; where an adjustment fails, of its start.
    xyz_m : (n_points, 3) float64, m
        In the frame of the poses; NaN where unknown.
    """
    if image_points is None:
        return []
    measured = np.unique(block.fiducial_points.image)
    films = np.intersect1d(measured, image_points.interior.image).tolist()
    if len(films) < 2:
        return []
    oriented = _Oriented(block, image_points, poses, xyz_m)
    far, worst = oriented.worst(films)
    pairs = list(itertools.combinations(far or worst, 2))
    limit = 2 * np.log(max(len(pairs), 1) / NOT_EXCHANGED)
    ratios = [(pair, _exchanged(oriented.without(far or list(pair)), *pair)) for pair in pairs]
    return [_finding(block, pair, off_mm) for pair, (T, off_mm) in ratios if limit < T]


def _exchanged(oriented: _Oriented, a: int, b: int) -> tuple[float, tuple[float, float]]:
    """T, and by how much the two are off by their own marks, and by those of the other, mm."""
    gains, own, other = [], [], []
    for image, marks_of in ((a, b), (b, a)):
        by_other, freedom = oriented.off_mm(image, marks_of)
        if not np.isfinite(by_other):
            return 0.0, (np.inf, np.inf)
        own.append(oriented.off_mm(image, image)[0])
        other.append(by_other)
        gains.append(freedom * ((own[-1] / by_other) ** 2 - 1))
    return (sum(gains) if min(gains) > 0 else 0.0), (max(own), max(other))


def _off(xy_mm: Float, c_mm: Float | float, xyz_m: Float, position_m: Float, ground_from_image: Float) -> Float:
    """Distances of image points from where orientations see their points, (n,), mm."""
    n = len(xy_mm)
    X0, R = np.broadcast_to(position_m, (n, 3)), np.broadcast_to(ground_from_image, (n, 3, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.linalg.norm(project(in_image_axes(X0, R, xyz_m), np.zeros(n) + c_mm) - xy_mm, axis=1))


def _finding(block: Block, pair: tuple[int, int], off_mm: tuple[float, float]) -> Finding:
    first, second = (str(block.images.id[image]) for image in pair)
    own, other = (f"{1e3 * off:,.0f} um" if np.isfinite(off) else "any distance" for off in off_mm)
    text = (
        f"images {first} and {second} may have each other's image points, or each other's fiducial marks: by the marks "
        f"of the other their points fit to {other}, by their own to {own}"
    )
    row = int(np.flatnonzero(block.image_points.image == pair[0])[0])
    remedy = "look at both; if so exchange the two ids in one of the tables; a start bent by wrong control looks alike"
    where = read_at(block, block.image_points, row)
    return Finding("exchanged_marks", "warning", text, remedy, where=where, statistic=off_mm[1] / off_mm[0])
