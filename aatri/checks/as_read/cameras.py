"""Field of view, scale and ground sampling distance of each camera; values that no camera and no flight has.

    field of view    2 atan(d / 2c), d the diagonal of the format
    scale            distance / c, from positions to the control they see, else c |X_i - X_j| / |x_i - x_j| of two
                     control points of an image; of digital images times the pixel: ground sampling distance

Seen: wrong units of principal distance, pixel size or coordinates, which an adjustment hides in its orientations.
Test: a field of view below 1 or above 150 degrees, a ground sampling distance below 0.01 mm or above 100 m, a scale
below 1 : 2,000,000.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.camera.pixels import half_format_mm
from aatri.checks.finding import Finding
from aatri.checks.limits import FIELD_OF_VIEW_DEG, SAMPLING_M, SMALLEST_SCALE
from aatri.observations.control import control_of
from aatri.units import length


@dataclass(frozen=True)
class CameraFrames:
    """Cameras of a block."""

    id: Sequence[str]
    principal_distance_mm: Float
    """(c,), mm."""
    half_format_mm: Float
    """(c, 2), mm. From the principal point; NaN not known."""
    pixel_mm: Float
    """(c,), mm. NaN for film measured in a comparator."""


def cameras_of(block: Block) -> CameraFrames:
    """The cameras with their format, or where their marks lie."""
    c = block.cameras
    digital = np.asarray(c.kind == "digital")
    pixel = np.where(digital, np.sqrt(c.pixel_size_mm.prod(axis=1)), np.nan)
    half = half_format_mm(digital, c.format, c.pixel_size_mm)
    marks = np.zeros_like(half)
    np.maximum.at(marks, block.fiducials.camera, np.abs(block.fiducials.xy_mm))
    half = np.where(np.isnan(half) & (marks > 0), marks, half)  # the image reaches as far as its marks, at least
    return CameraFrames(c.id.tolist(), c.principal_distance_mm, half, pixel)


def camera_figures(cameras: CameraFrames, camera_of_ray: Int, distance_m: Float) -> list[Finding]:
    """A line per camera from what is given, before anything is oriented.

    Parameters
    ----------
    camera_of_ray : (k,) int
        Camera of each ray to a control point.
    distance_m : (k,) float64, m
        Length of the ray.
    """
    findings = []
    for k, name in enumerate(cameras.id):
        distances = distance_m[camera_of_ray == k]
        away = float(np.median(distances)) if len(distances) else np.nan
        parts, wrong = _figures(cameras, k, away)
        parts = [f"{length(away)} from the control it shows"] * bool(len(distances)) + parts
        if parts:
            findings.append(Finding("cameras", "note", ", ".join(parts), where=f"camera {name}"))
        findings += [Finding("cameras", "warning", text, remedy, where=f"camera {name}") for text, remedy in wrong]
    return findings


def _figures(cameras: CameraFrames, k: int, distance_m: float) -> tuple[list[str], list[tuple[str, str]]]:
    """Field of view, scale and ground sampling distance of a camera at a distance, in words; what cannot be."""
    c, pixel = float(cameras.principal_distance_mm[k]), float(cameras.pixel_mm[k])
    diagonal = 2 * float(np.linalg.norm(cameras.half_format_mm[k]))
    field = float(np.degrees(2 * np.arctan(diagonal / (2 * c))))
    sampling, scale = distance_m / c * pixel, distance_m / c * 1000
    parts, wrong = [] if np.isnan(field) else [f"field of view {field:.3g} deg"], []
    parts += [f"scale 1 : {scale:,.0f}"] * bool(np.isfinite(scale))
    parts += [f"ground sampling distance {length(sampling)}"] * bool(np.isfinite(sampling))
    if field < FIELD_OF_VIEW_DEG[0] or field > FIELD_OF_VIEW_DEG[1]:
        text = f"a field of view of {field:.3g} deg, principal distance {c:g} mm, format {diagonal:.4g} mm across"
        wrong.append((text, "check the units of both, mm"))
    if sampling < SAMPLING_M[0] or sampling > SAMPLING_M[1]:
        text = f"a ground sampling distance of {length(sampling)}, principal distance {c:g} mm, pixel {pixel:g} mm"
        wrong.append((text, "check the units of both and of coordinates"))
    if np.isnan(sampling) and scale > SMALLEST_SCALE:
        text = f"a scale of 1 : {scale:,.0f}, principal distance {c:g} mm"
        wrong.append((text, "check its unit and that of coordinates"))
    return parts, wrong


def distances_by_scale(block: Block, xy_mm: Float, usable: Bool) -> tuple[Int, Float]:
    """Cameras and their distances from the ground by the scale of images with two control points or more.

    Of neighbouring control points of each image; vertical images are thought of, others have about the same.

    Parameters
    ----------
    xy_mm : (k, 2) float64, mm
        Image points.
    usable : (k,) bool
    """
    control, points, c = control_of(block), block.image_points, block.cameras
    number = control.row_in_full(len(block.points))
    rows = np.flatnonzero(usable & (number[points.point] >= 0))
    rows = rows[np.argsort(points.image[rows], kind="stable")]
    first, second = rows[:-1], rows[1:]
    apart = np.linalg.norm(xy_mm[second] - xy_mm[first], axis=1)
    use = (points.image[first] == points.image[second]) & (apart > 0)
    first, second, apart = first[use], second[use], apart[use]
    X = [control.xyz_m[number[points.point[end]]] for end in (first, second)]
    camera = block.images.camera[points.image[first]]
    return camera, c.principal_distance_mm[camera] * np.linalg.norm(X[1] - X[0], axis=1) / apart
