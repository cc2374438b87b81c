"""Orientations held against the points that their images show.

Seen: heights of the wrong sign, exchanged axes, angles of another convention; control with a wrong id or coordinate.
Test: more than 5 % of the points of a camera lie behind it; all its images look up at points above them, where
something says which way is up (the model of another program may lie as it likes); they are higher than any flight; a
control point projects beyond the format, by more than a tenth of it, of an image that shows it (orientations are
approximate). Where most of it does, the orientations are wrong, and not so many coordinates. After the adjustment: all
images of a camera look the other way than at the start, as mirrored images of flat ground do, which fit from below it.
"""

import numpy as np

from aatri.adapters.interior.photo_coordinates import half_format_of
from aatri.arrays import Bool, Float, Int, Text, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.checks.finding import Finding
from aatri.checks.limits import BEHIND, CONTROL_MARGIN, FEWEST_OF_MOST, HIGHEST_FLIGHT_M, UPWARDS
from aatri.codes import OBSERVED_VALUE
from aatri.observations.control import control_of
from aatri.observations.poses import Poses
from aatri.units import length

CHUNK = 100_000
"""Image points at a time: a rotation for each of them would fill the memory."""


def unlikely_orientations(block: Block, position_m: Float, ground_from_image: Float, xyz_m: Float) -> list[Finding]:
    """A line of the flying height of each camera, and what no flight has.

    Parameters
    ----------
    position_m, ground_from_image : (n, 3), (n, 3, 3) float64, m
        Of the block's images, in its first frame; NaN where not oriented.
    xyz_m : (p, 3) float64, m
        Of the block's points; NaN where not known.
    """
    points, findings = block.image_points, []
    # what says which way is up: a coordinate system, a height of control, an observed position
    heights = control_of(block).given[:, 2]
    observed = block.exterior.position_use == OBSERVED_VALUE
    upright = bool((block.frames.crs[:1] != "local").any() or heights.any() or observed.any())
    usable = points.active & block.images.active[points.image]
    usable &= finite_rows(position_m)[points.image] & finite_rows(xyz_m)[points.point]
    image, point = points.image[usable], points.point[usable]
    depth, height, camera = np.empty(len(image)), np.empty(len(image)), block.images.camera[image]
    for first in range(0, len(image), CHUNK):
        rows = slice(first, first + CHUNK)
        away = xyz_m[point[rows]] - position_m[image[rows]]
        depth[rows] = -np.einsum("kj,kj->k", ground_from_image[image[rows], :, 2], away)
        height[rows] = -away[:, 2]
    for k in np.unique(camera).tolist():
        of_camera, where = camera == k, f"camera {block.cameras.id[k]}"
        behind = float(np.mean(depth[of_camera] <= 0))
        above_m = float(np.median(height[of_camera]))
        text = f"{length(above_m)} above its points"
        if above_m > HIGHEST_FLIGHT_M:
            remedy = "check the unit of control and positions, and the principal distance"
            text = f"{text}, where only satellites are"
            findings.append(Finding("orientations", "warning", text, remedy, where=where, statistic=above_m))
        else:
            findings.append(Finding("orientations", "note", text, where=where))
        if behind > BEHIND:
            text, remedy = f"{behind:.0%} of its points lie behind it", "check axes, angles and the sign of heights"
            findings.append(Finding("orientations", "warning", text, remedy, where=where, statistic=behind))
        elif upright and float(np.mean(height[of_camera] < -UPWARDS * np.abs(depth[of_camera]))) > 1 - BEHIND:
            text, remedy = "all its images look up at points above them", "unless this is a ceiling, check the sign of "
            remedy += "heights and the order of axes"
            findings.append(Finding("orientations", "warning", text, remedy, where=where))
    return findings


def few_oriented(initial: Solution) -> list[Finding]:
    """Where an adjustment failed that began with the smaller part of the images, placed by strips: how to begin."""
    oriented = initial.images.oriented
    if oriented.mean() >= 0.5 or not initial.method.startswith(("strip_adjustment", "absolute_orientation")):
        return []
    count = f"{int(oriented.sum())} of {len(oriented)}"
    text = f"the start ({initial.method}) orients {count} images, which may be the reason"
    remedy = "use initial_orientation/graph instead of relative orientation, strips and what follows them: it orients "
    remedy += "image by image"
    return [Finding("orientations", "warning", text, remedy, statistic=float(oriented.mean()))]


def control_outside(block: Block, position_m: Float, ground_from_image: Float) -> list[Finding]:
    """How much of the control projects into the images that show it; what does not, by name."""
    control, points = control_of(block), block.image_points
    number = control.row_in_full(len(block.points))
    c, camera = block.cameras, block.images.camera[points.image]
    half = half_format_of(block)
    usable: Bool = points.active & block.images.active[points.image] & (number[points.point] >= 0)
    usable &= finite_rows(position_m)[points.image] & finite_rows(half)[camera]
    if not usable.any():
        return []
    image, row, camera = points.image[usable], number[points.point[usable]], camera[usable]
    away = control.xyz_m[row] - position_m[image]
    u = np.einsum("kji,kj->ki", ground_from_image[image], away)
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = -c.principal_distance_mm[camera, None] * u[:, :2] / u[:, 2:]
    inside = (u[:, 2] < 0) & (np.abs(xy) <= (1 + 2 * CONTROL_MARGIN) * half[camera]).all(axis=1)
    outside, judged = np.unique(row[~inside]), np.unique(row)
    text = f"{len(judged) - len(outside)} of {len(judged)} control points lie in what their images show"
    findings = [Finding("orientations", "note", text)]
    if not len(outside):
        return findings
    nearest = {k: float(np.linalg.norm(away[row == k, :2], axis=1).min()) for k in outside.tolist()}
    names = block.points.id[control.point]
    ids = tuple(f"{names[k]} ({length(nearest[k])} off)" for k in sorted(nearest, key=lambda k: -nearest[k]))
    if len(outside) > len(judged) / 2 and (len(judged) >= FEWEST_OF_MOST or len(outside) == len(judged) > 2):
        text = f"{len(outside)} of {len(judged)} control points lie outside of what their images show"
        remedy = "check the angles and positions of the start, and axes and frame of the control"
        findings.append(Finding("orientations", "warning", text, remedy, ids=ids))
    else:
        text = "control points outside of what their images show, with the distance from the nearest"
        rows = {"control": control.row[outside]}
        findings.append(Finding("orientations", "warning", text, "check coordinates and ids", ids=ids, rows=rows))
    return findings


def turned_over(start: Poses, adjusted: Poses, camera: Int, cameras: Text) -> list[Finding]:
    """Cameras all of whose images, two and more, look the other way than at the start.

    Parameters
    ----------
    camera : (n,) int
        Of each image.
    cameras : (c,) str
        Their ids.
    """
    both, findings = start.oriented & adjusted.oriented, []
    along = np.einsum("nj,nj->n", start.ground_from_image[..., 2], adjusted.ground_from_image[..., 2])
    for k in np.unique(camera[both]).tolist():
        of_camera = along[both & (camera == k)]
        if len(of_camera) > 1 and (of_camera < -UPWARDS).all():
            text = "all its images look the other way than at the start: that was wrong, or the images are mirrored"
            remedy = "check the angles of the start, the y axis of its image coordinates, the axes of control"
            findings.append(Finding("orientations", "warning", text, remedy, where=f"camera {cameras[k]}"))
    return findings
