"""One line of sanity per camera and one of the control, once orientations are known.

    field of view        2 atan(d / 2c), d the diagonal of the format
    flying height        Z0 - Z, medians over the images of the camera and the points they show
    scale                distance / c, the distance along the axis of the image; of digital images times the pixel: GSD
    control inside       a control point projects into the format, by more than a tenth of it, of each image that
                         shows it

Figures no camera and no flight has are warnings: a field of view below 1 or above 170 degrees, a ground sampling
distance below 0.01 mm or above 100 m, a scale below 1 : 2,000,000, points behind their camera, cameras that look up at
points above them, control outside of what its images show. They come from wrong units, principal distances, pixel
sizes, signs and zones, which an adjustment can hide or cannot survive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.notes import Note
from aatri.orientation.plausibility.control import length

FIELD_OF_VIEW_DEG = (1.0, 170.0)
SAMPLING_M = (1e-5, 100.0)
SMALLEST_SCALE = 2e6
FORMAT_MARGIN = 0.1
"""So far beyond its edge, as a share of the format, a control point may project: orientations are approximate."""

UPWARDS = 0.7
"""An image whose points lie higher by more than this share of their distance looks upwards."""

BEHIND = 0.05
"""A larger share of points behind their camera is no matter of a few wrong points."""


@dataclass(frozen=True)
class Cameras:
    """Cameras of a block.

    Attributes
    ----------
    id : sequence of str
    principal_distance_mm : (c,) float64, mm
    half_format_mm : (c, 2) float64, mm
        From the principal point; NaN not known.
    pixel_mm : (c,) float64, mm
        NaN for film measured in a comparator.
    """

    id: Sequence[str]
    principal_distance_mm: Float
    half_format_mm: Float
    pixel_mm: Float


def camera_notes(
    cameras: Cameras, camera_of_image: Int, position_m: Float, ground_from_image: Float, xyz_m: Float,
    ray_image: Int, ray_point: Int,
) -> tuple[Note, ...]:  # fmt: skip
    """A line per camera: field of view, flying height, scale or ground sampling distance.

    Parameters
    ----------
    camera_of_image : (n,) int
    position_m : (n, 3) float64, m
        NaN where an image is not oriented.
    ground_from_image : (n, 3, 3) float64
    xyz_m : (p, 3) float64, m
        NaN where a point has no coordinates.
    ray_image, ray_point : (k,) int
        Image points in use.

    Returns
    -------
    tuple of Note
    """
    known = np.asarray(np.isfinite(position_m).all(axis=1))[ray_image]
    known &= np.asarray(np.isfinite(xyz_m).all(axis=1))[ray_point]
    image, point = ray_image[known], ray_point[known]
    u = np.einsum("kji,kj->ki", ground_from_image[image], xyz_m[point] - position_m[image])
    depth, height = -u[:, 2], position_m[image, 2] - xyz_m[point, 2]
    notes = []
    for k, name in enumerate(cameras.id):
        mine = camera_of_image[image] == k
        if mine.any():
            notes += _one_camera(cameras, k, str(name), depth[mine], height[mine])
    return tuple(notes)


def given_notes(cameras: Cameras, camera_of_ray: Int, distance_m: Float) -> tuple[Note, ...]:
    """A line per camera from what is given, before anything is oriented.

    Parameters
    ----------
    camera_of_ray : (k,) int
        Camera of each ray from a known position to a control point.
    distance_m : (k,) float64, m
        Length of the ray.
    """
    notes = []
    for k, name in enumerate(cameras.id):
        mine = distance_m[camera_of_ray == k]
        away = float(np.median(mine)) if len(mine) else np.nan
        parts, warnings = _figures(cameras, k, str(name), away)
        parts = [f"{length(away)} from the control it shows"] * bool(len(mine)) + parts
        if parts:
            notes.append(Note("note", f"camera {name}, as given: {', '.join(parts)}"))
        notes += warnings
    return tuple(notes)


def _figures(cameras: Cameras, k: int, name: str, distance_m: float) -> tuple[list[str], list[Note]]:
    """Field of view, scale and ground sampling distance of a camera at a distance, in words; what cannot be."""
    c, pixel = float(cameras.principal_distance_mm[k]), float(cameras.pixel_mm[k])
    diagonal = 2 * float(np.linalg.norm(cameras.half_format_mm[k]))
    field = float(np.degrees(2 * np.arctan(diagonal / (2 * c))))
    sampling = distance_m / c * pixel
    parts = [] if np.isnan(field) else [f"field of view {field:.3g} deg"]
    if np.isfinite(distance_m):
        parts.append(f"scale 1 : {distance_m / c * 1000:,.0f}")
    if np.isfinite(sampling):
        parts.append(f"ground sampling distance {length(sampling)}")
    notes = []
    if field < FIELD_OF_VIEW_DEG[0] or field > FIELD_OF_VIEW_DEG[1]:
        notes.append(Note("warning", f"camera {name} has a field of view of {field:.3g} deg: principal distance "
                          f"{c:g} mm or format ({diagonal:.4g} mm across the diagonal) is wrong"))  # fmt: skip
    if sampling < SAMPLING_M[0] or sampling > SAMPLING_M[1]:
        notes.append(Note("warning", f"camera {name} has a ground sampling distance of {length(sampling)}: check "
                          f"principal distance ({c:g} mm), pixel size ({pixel:g} mm) and the unit of "
                          "coordinates"))  # fmt: skip
    if np.isnan(sampling) and distance_m / c * 1000 > SMALLEST_SCALE:
        notes.append(Note("warning", f"camera {name} has a scale of 1 : {distance_m / c * 1000:,.0f}: check principal "
                          f"distance ({c:g} mm) and the unit of coordinates"))  # fmt: skip
    return parts, notes


def _one_camera(cameras: Cameras, k: int, name: str, depth: Float, height: Float) -> list[Note]:
    distance, behind = float(np.median(np.abs(depth))), float(np.mean(depth <= 0))
    parts, warnings = _figures(cameras, k, name, distance)
    field = [part for part in parts if part.startswith("field")]
    parts = [*field, f"{length(float(np.median(height)))} above its points", *parts[len(field) :]]
    notes = [Note("note", f"camera {name}: {', '.join(parts)}"), *warnings]
    if float(np.mean(height < -UPWARDS * np.abs(depth))) > 1 - BEHIND and behind <= BEHIND:
        notes.append(Note("warning", f"all images of camera {name} look up at points above them: unless this is a "
                          "ceiling, heights have the wrong sign or two axes are exchanged"))  # fmt: skip
    if behind > BEHIND:
        notes.append(Note("warning", f"{behind:.0%} of the points of camera {name} lie behind it: check axes, angles "
                          "and the sign of heights"))  # fmt: skip
    return notes


def control_notes(
    cameras: Cameras, camera_of_image: Int, position_m: Float, ground_from_image: Float, ids: Sequence[str],
    control_m: Float, ray_image: Int, ray_control: Int,
) -> tuple[Note, ...]:  # fmt: skip
    """How much of the control projects into the images that show it; what does not, by name.

    Parameters
    ----------
    ids : (m,) str
    control_m : (m, 3) float64, m
        Coordinates as given; points without all three are not judged.
    ray_image, ray_control : (k,) int

    Returns
    -------
    tuple of Note
        None if no control can be judged.
    """
    camera = camera_of_image[ray_image]
    known = np.isfinite(position_m[ray_image]).all(axis=1) & np.isfinite(control_m[ray_control]).all(axis=1)
    known &= np.isfinite(cameras.half_format_mm[camera]).all(axis=1)
    image, control, camera = ray_image[known], ray_control[known], camera[known]
    if not len(image):
        return ()
    u = np.einsum("kji,kj->ki", ground_from_image[image], control_m[control] - position_m[image])
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = -cameras.principal_distance_mm[camera, None] * u[:, :2] / u[:, 2:]
    limit = (1 + 2 * FORMAT_MARGIN) * cameras.half_format_mm[camera]
    inside: Bool = (u[:, 2] < 0) & (np.abs(xy) <= limit).all(axis=1)
    outside = np.unique(control[~inside])
    judged = np.unique(control)
    notes = [
        Note("note", f"{len(judged) - len(outside)} of {len(judged)} control points lie in what their images show")
    ]
    if len(outside):
        off = {int(k): np.inf for k in outside}
        plan = np.linalg.norm(control_m[control, :2] - position_m[image, :2], axis=1)
        for k, d in zip(control.tolist(), plan.tolist()):
            if k in off:
                off[k] = min(off[k], d)
        names = tuple(
            f"{ids[k]} ({length(off[k])} from the nearest of them)" for k in sorted(off, key=lambda k: -off[k])
        )
        notes.append(Note("warning", "control outside of what its images show: check coordinates and ids", names))
    return tuple(notes)
