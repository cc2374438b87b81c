"""Orientations of a start held against the rays of their images: from the right ones all rays of a point meet.

Images that are mirrored, and that no control contradicts, fit a mirrored object with the residuals of the right one.

Seen: rays that miss each other by more than `POOR_START_RAD` in the median; or two images whose rays miss so what the
others intersect.
Test: a reading of the angles, or of the axes of the images, or the two orientations exchanged, by which they miss by
less than 1 deg, and by a fifth of what they do as declared. Of 2,000 made-up blocks of 3 to 10 images, their angles 0.1
to 40 degrees off, none was read otherwise, and none had orientations to exchange. Where nothing is found, misses beyond
`WRONG_START_RAD` are noted, and told if the adjustment fails.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.checks.at_start.angle_readings import agreeing_reading
from aatri.checks.finding import Finding
from aatri.checks.limits import (
    AGREEING_READING,
    FEWEST_OF_START,
    MOST_EXCHANGED,
    MOST_RAYS_OF_START,
    POOR_START_RAD,
    WRONG_ATTITUDES_RAD,
    WRONG_START_RAD,
)
from aatri.geometry.intersection import intersect_rays
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses

IMAGE_AXES = {
    "y of the image coordinates the other way": np.diag([1.0, -1.0, 1.0]),
    "x of the image coordinates the other way": np.diag([-1.0, 1.0, 1.0]),
    "x and y of the image coordinates exchanged": np.eye(3)[[1, 0, 2]],
    "the images turned by 90 deg": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "the images turned by 180 deg": np.diag([-1.0, -1.0, 1.0]),
    "the images turned by 270 deg": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""What the axes of image coordinates may be instead."""


@dataclass(frozen=True)
class _Rays:
    """Rays of whole points, in images that have angles and a position."""

    images: Int
    """(i,). Rows of images."""
    image: Int
    """(n,). Of each ray, among them."""
    point: Int
    in_image: Float
    """(n, 3), mm."""
    position_m: Float
    """(i, 3), m."""

    def missing_rad(self, rotation: Float) -> float:
        """Angle by which rays miss the points they have in common, in the median."""
        angle = self.angles_rad(rotation, self.position_m, np.ones(len(self.image), dtype=bool))
        angle = angle[(np.bincount(self.point)[self.point] > 1) & np.isfinite(angle)]
        return float(np.median(angle)) if len(angle) else np.pi

    def angles_rad(self, rotation: Float, position_m: Float, of_points: Bool) -> Float:
        """Angles between rays and the points that some of them intersect, (n,); NaN where they do not."""
        X0, u = position_m[self.image], np.einsum("nij,nj->ni", rotation[self.image], self.in_image)
        xyz = intersect_rays(X0[of_points], u[of_points], self.point[of_points], int(self.point.max()) + 1)
        away = xyz[self.point] - X0
        return np.asarray(np.arctan2(np.linalg.norm(np.cross(u, away), axis=1), np.einsum("ni,ni->n", u, away)))


def start_rays(block: Block, rays: ImagePointRows, start: Poses) -> list[Finding]:
    """Orientations of a start that are not those of their images: angles, image axes, two of them exchanged.

    Parameters
    ----------
    start : Poses
        Of the block's images, in its first frame.
    """
    e, angles_rad = block.exterior, np.full_like(start.position_m, np.nan)
    angles_rad[e.image] = e.angles_rad
    placed = start.oriented & finite_rows(angles_rad)
    use = np.flatnonzero(rays.active & placed[rays.image])
    use = use[rays.point[use] % -(-max(len(use), 1) // MOST_RAYS_OF_START) == 0]  # whole points, evenly
    images, image = np.unique(rays.image[use], return_inverse=True)
    if len(images) < FEWEST_OF_START:
        return []
    in_image = np.column_stack([rays.xy_mm[use], -rays.c_mm[use]])
    chosen = _Rays(images, image, rays.point[use], in_image, start.position_m[images])
    declared = start.ground_from_image[images]
    read = _read_otherwise(chosen, angles_rad[images], declared, block.rotation)
    if read and read[0].level != "note":
        return read
    return _exchanged(chosen, declared, block.images.id[images].tolist()) or read


def _read_otherwise(rays: _Rays, angles_rad: Float, declared: Float, system: str) -> list[Finding]:
    """Angles, or axes of images, in another convention than declared."""
    missing = rays.missing_rad(declared)
    if missing <= POOR_START_RAD:
        return []
    best, what = min((rays.missing_rad(declared @ axes), name) for name, axes in IMAGE_AXES.items())
    remedy = "check the axes of the image coordinates (pixel: y, origin; format)"
    reading = agreeing_reading(angles_rad, declared, rays.missing_rad, system)
    if reading is not None and rays.missing_rad(reading[1]) < best:
        best, what = rays.missing_rad(reading[1]), f"the angles read as {reading[0]}"
        remedy = f"declare them as {reading[0]} (rotation, heading, units in block.yaml), or convert them"
    text = f"rays from the start orientations as {system} miss each other by {np.degrees(missing):.3g} deg"
    if best > min(WRONG_ATTITUDES_RAD, AGREEING_READING * missing):
        wrong = missing > WRONG_START_RAD
        remedy = "check their angles or quaternions, their positions or translations, and the images they belong to"
        return [Finding("start_rays", "note", text, remedy, statistic=missing)] if wrong else []
    text += f", with {what} by {np.degrees(best):.2g} deg"
    return [Finding("start_rays", "warning", text, remedy, statistic=missing)]


def _exchanged(rays: _Rays, declared: Float, names: list[str]) -> list[Finding]:
    """Two images with each other's orientation."""
    n, every = len(names), np.ones(len(rays.image), dtype=bool)
    angle = rays.angles_rad(declared, rays.position_m, every)
    medians = np.array([_median(angle[rays.image == k]) for k in range(n)])
    worst = [k for k in np.argsort(-medians, kind="stable")[:MOST_EXCHANGED].tolist() if medians[k] > POOR_START_RAD]
    for a, b in itertools.combinations(sorted(worst), 2):
        of_two, order = np.isin(rays.image, (a, b)), np.arange(n)
        order[[a, b]] = b, a
        own = rays.angles_rad(declared, rays.position_m, ~of_two)
        other = rays.angles_rad(declared[order], rays.position_m[order], ~of_two)
        missing = float(np.min([_median(own[rays.image == k]) for k in (a, b)]))  # NaN where one of the two is
        left = float(np.max([_median(other[rays.image == k]) for k in (a, b)]))
        if missing > POOR_START_RAD and left <= min(WRONG_ATTITUDES_RAD, AGREEING_READING * missing):
            text = f"rays of two images miss what the others intersect by {np.degrees(missing):.3g} deg, with their "
            text += f"start orientations exchanged by {np.degrees(left):.2g} deg"
            ids, remedy = (names[a], names[b]), "exchange the orientations, or the measurements, of the two images"
            return [Finding("start_rays", "warning", text, remedy, ids=ids, statistic=float(missing))]
    return []


def _median(angles_rad: Float) -> float:
    """Of the angles that there are; NaN of too few."""
    angles_rad = angles_rad[np.isfinite(angles_rad)]
    return float(np.median(angles_rad)) if len(angles_rad) >= FEWEST_OF_START else np.nan
