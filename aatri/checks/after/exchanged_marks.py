"""Film images with each other's image points, beside marks of their own.

The marks of image b transform the image points of a as if these had been measured on the film of b. With r_ab the
residuals of a's points in a resection by the marks of b, known as an affine transformation is known by its marks,

    Q_ab = min over affine e of |r_ab - e(points of a)|^2 + |e(marks of b)|^2,   T = (Q_aa - Q_ab + Q_bb - Q_ba) / s^2

is twice the logarithm of the likelihood ratio of two hypotheses without unknowns of their own, s^2 the mean square that
an affine transformation of its own leaves the two images (n_a and n_b points, 2 (n_a + n_b) - 24 degrees of
freedom). Where nothing is exchanged T exceeds 2 ln k with a probability of 1 / k at most. Orientations are those
adjusted: a wrong control point bends a start, and what it bends may look like marks of another film. Where the
adjustment fails those of its start are all there is.

Seen: two film images whose points do not fit by the marks of the same image.
Test: T of each pair of the worst images, at 1e-4 for all of them, and each of the two better by the marks of the other.
Where the adjusted orientations are nearly right most pairs are left out by less: by a bound of T, as Q_ab is no less
than what an affine transformation leaves that no marks observe; then by T with r_ab to first order.
Points are those that other images intersect: all others, or where images are far off, all that are not.
Source: Neyman and Pearson 1933; Wald 1947 (bound of a likelihood ratio).
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.interior.photo_coordinates import measured_to_photo
from aatri.adjustment.statistics.limits import MEDIAN_SQUARE_OF_PLANE
from aatri.arrays import Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.checks.finding import Finding
from aatri.checks.limits import FAR_OFF, FEWEST_FITTING, MISFIT, MOST_MISFITS, NOT_EXCHANGED
from aatri.geometry.collinearity import collinearity, in_image_axes, project
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.vectors import unit
from aatri.observations.poses import Poses
from aatri.orientation.resection.adjustment import resect_images
from aatri.orientation.resection.start import start_orientation

NO_MARKS = np.zeros((0, 2))


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

    def worst(self, films: list[int]) -> tuple[list[int], list[int], float]:
        """Images that are far off what they see, each resected; those that fit worst; what most are off."""
        m, c_mm = self.image_points.measurements, self.block.cameras.principal_distance_mm[self.block.images.camera]
        rows = np.flatnonzero(m.active & np.isin(m.image, films))
        rows = rows[np.argsort(m.image[rows], kind="stable")]
        X0, R = self.poses.position_m, self.poses.ground_from_image
        fit = resect_images(m.xy_mm[rows], m.sigma_mm[rows], m.image[rows], m.point[rows], c_mm, self.xyz_m, X0, R)
        of_image = m.image[rows]
        placed = fit.position_m[of_image], fit.ground_from_image[of_image]
        off = _lengths(_residuals(m.xy_mm[rows], c_mm[of_image], self.xyz_m[m.point[rows]], *placed))
        off_of = np.split(off, np.cumsum(np.bincount(of_image, minlength=len(c_mm)))[:-1])
        median_mm = np.array([np.nanmedian(off_of[k]) if fit.resected[k] else np.inf for k in films])
        usual = float(np.quantile(median_mm, 0.25, method="lower"))
        order = np.argsort(-median_mm, kind="stable")[:MOST_MISFITS]
        far, worst = ([films[k] for k in order.tolist() if median_mm[k] > times * usual] for times in (FAR_OFF, MISFIT))
        return far, worst, usual

    def without(self, images: list[int]) -> "_Oriented":
        """With the points that the other images intersect."""
        m, cameras = self.image_points.measurements, self.block.cameras
        used = m.active & finite_rows(m.xy_mm) & self.poses.oriented[m.image] & ~np.isin(m.image, images)
        used &= np.isin(m.point, m.point[np.isin(m.image, images)])
        image = m.image[used]
        c_mm = cameras.principal_distance_mm[self.block.images.camera[image]]
        in_image = np.column_stack([m.xy_mm[used], -c_mm])
        direction = unit(np.einsum("nij,nj->ni", self.poses.ground_from_image[image], in_image))
        xyz_m = intersect_rays(self.poses.position_m[image], direction, m.point[used], len(self.xyz_m))
        return replace(self, xyz_m=xyz_m)

    def by_marks(self, image: int, marks_of: int) -> tuple[Float, Float]:
        """Photo coordinates of the image's points by the marks of an image, and their residuals, (n, 2), mm."""
        m, rows = self.image_points.measurements, self.rays(image)
        c_mm = float(self.block.cameras.principal_distance_mm[self.block.images.camera[image]])
        xy, xyz = m.xy_mm[rows] + self._moved(rows, image, marks_of), self.xyz_m[m.point[rows]]
        offered = (self.poses.position_m[image], self.poses.ground_from_image[image])
        if len(rows) < FEWEST_FITTING or (start := start_orientation(xy, c_mm, xyz, offered=offered)) is None:
            return xy, np.full_like(xy, np.inf)
        of_one, point = np.zeros(len(rows), np.int64), np.arange(len(rows))
        fit = resect_images(xy, m.sigma_mm[rows], of_one, point, np.array([c_mm]), xyz, start[0][None], start[1][None])
        return xy, _residuals(xy, c_mm, xyz, fit.position_m, fit.ground_from_image)

    def nearly_by_marks(self, image: int, marks_of: int) -> tuple[Float, Float]:
        """As `by_marks`, to first order from the adjusted orientation: without a start, and without iterations.

        By a turn and a shift in the image, which may be large as a film lies in the comparator, the coordinates by its
        own marks are brought to those by the others first.
        """
        m, rows = self.image_points.measurements, self.rays(image)
        own = m.xy_mm[rows]
        xy = own + self._moved(rows, image, marks_of)
        if len(rows) < FEWEST_FITTING:
            return xy, np.full_like(xy, np.inf)
        X0, R = self.poses.position_m[image], self.poses.ground_from_image[image]
        at_ray = np.tile(X0, (len(rows), 1)), np.tile(R, (len(rows), 1, 1))
        c_mm = np.full(len(rows), self.block.cameras.principal_distance_mm[self.block.images.camera[image]])
        projected, by_pose, _ = collinearity(*at_ray, self.xyz_m[m.point[rows]], c_mm)
        own_mean, mean = own.mean(axis=0), xy.mean(axis=0)
        M = (own - own_mean).T @ (xy - mean)
        cosine, sine = M[0, 0] + M[1, 1], M[0, 1] - M[1, 0]
        turn = np.array([[cosine, -sine], [sine, cosine]]) / np.hypot(cosine, sine)
        residuals = ((projected - own_mean) @ turn.T - (xy - mean)).ravel()
        design = (turn @ by_pose).reshape(-1, 6)
        residuals -= design @ np.linalg.lstsq(design, residuals, rcond=None)[0]
        return xy, residuals.reshape(-1, 2)

    def most_gained(self, image: int) -> float:
        """Q by its own marks, less Q where no marks observe the transformation, mm^2: marks of others gain no more."""
        xy, residuals = self.nearly_by_marks(image, image)
        return _square_left(xy, residuals, self.marks_mm(image)) - _square_left(xy, residuals, NO_MARKS)

    def marks_mm(self, image: int) -> Float:
        """Photo coordinates of an image's marks, (n, 2), mm."""
        marks, interior = self.block.fiducial_points, self.image_points.interior
        uv = marks.xy[marks.image == image]
        return measured_to_photo(interior, np.full(len(uv), np.flatnonzero(interior.image == image)[0]), uv)

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
    far, worst, usual_mm = oriented.worst(films)
    pairs = list(itertools.combinations(far or worst, 2))
    limit = 2 * np.log(max(len(pairs), 1) / NOT_EXCHANGED)
    most = {image: oriented.without([image]).most_gained(image) for image in ([] if far else worst)}
    findings = list[Finding]()
    for pair in pairs:
        if not far and most[pair[0]] + most[pair[1]] < limit * usual_mm**2 / MEDIAN_SQUARE_OF_PLANE:
            continue
        rest = oriented.without(far or list(pair))
        if far or limit < _exchanged(rest, pair, rest.nearly_by_marks)[0]:
            T, off_mm = _exchanged(rest, pair, rest.by_marks)
            findings += [_finding(block, pair, off_mm)] if limit < T else []
    return findings


def _exchanged(
    oriented: _Oriented, pair: tuple[int, int], by_marks: Callable[[int, int], tuple[Float, Float]]
) -> tuple[float, tuple[float, float]]:
    """T, and by how much the two are off by their own marks, and by those of the other, mm."""
    own = [by_marks(image, image) for image in pair]
    other = [by_marks(image, marks_of) for image, marks_of in (pair, pair[::-1])]
    if not all(len(xy_mm) for xy_mm, _ in (*own, *other)):
        return 0.0, (np.inf, np.inf)  # one sees no point that the adjustment has
    off_own, off_other = (max(float(np.median(_lengths(r_mm))) for _, r_mm in pair) for pair in (own, other))
    off_mm = (off_own, off_other)
    if not np.isfinite(off_other):
        return 0.0, (np.inf, np.inf)
    freedom = sum(2 * len(xy_mm) - 12 for xy_mm, _ in other)
    variance = sum(_square_left(*fit, NO_MARKS) for fit in other) / max(freedom, 1)
    if freedom < 1 or not variance:
        return 0.0, off_mm
    marks_mm = [oriented.marks_mm(image) for image in pair]
    gains = [_square_left(*own[k], marks_mm[k]) - _square_left(*other[k], marks_mm[1 - k]) for k in (0, 1)]
    return (sum(gains) / variance if min(gains) > 0 else 0.0), off_mm


def _square_left(xy_mm: Float, residuals_mm: Float, marks_mm: Float) -> float:
    """Q: what an affine transformation leaves of residuals, where at the marks it is observed to be zero, mm^2."""
    if not np.isfinite(residuals_mm).all():
        return np.inf
    at = np.vstack([xy_mm, marks_mm])
    design, observed = np.column_stack([at, np.ones(len(at))]), np.vstack([residuals_mm, np.zeros_like(marks_mm)])
    return float(((observed - design @ np.linalg.lstsq(design, observed, rcond=None)[0]) ** 2).sum())


def _residuals(xy_mm: Float, c_mm: Float | float, xyz_m: Float, position_m: Float, ground_from_image: Float) -> Float:
    """Where orientations see their points, less the image points, (n, 2), mm."""
    n = len(xy_mm)
    X0, R = np.broadcast_to(position_m, (n, 3)), np.broadcast_to(ground_from_image, (n, 3, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(project(in_image_axes(X0, R, xyz_m), np.zeros(n) + c_mm) - xy_mm)


def _lengths(residuals_mm: Float) -> Float:
    return np.asarray(np.linalg.norm(residuals_mm, axis=1))


def _finding(block: Block, pair: tuple[int, int], off_mm: tuple[float, float]) -> Finding:
    first, second = (str(block.images.id[image]) for image in pair)
    own, other = (f"{1e3 * off:,.0f} um" if np.isfinite(off) else "any distance" for off in off_mm)
    text = (
        f"images {first} and {second} may have each other's image points, or each other's fiducial marks: by the marks "
        f"of the other their points fit to {other}, by their own to {own}"
    )
    row = int(np.flatnonzero(block.image_points.image == pair[0])[0])
    remedy = "look at both; if so exchange the two ids in one of the tables; a start bent by wrong control looks alike"
    where = block.read_at(block.image_points, row)
    return Finding("exchanged_marks", "warning", text, remedy, where=where, statistic=off_mm[1] / off_mm[0])
