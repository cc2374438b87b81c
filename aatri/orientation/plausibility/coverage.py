"""What the image points of a camera cover of its format: all of them in a corner, or beyond its marks, is a wrong unit.

    share = largest extent of the points of all images / format,     reach = largest distance from the middle

Millimetres read as micrometres, inches as millimetres, pixels as millimetres shrink or blow up the bundle of rays,
which some adjustments survive with another principal distance. Where neither format nor marks are given, the angle
2 atan(reach / c) that the points span must be one that a camera has.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.notes import Note
from aatri.orientation.plausibility.cameras import FIELD_OF_VIEW_DEG, Cameras

FEWEST = 20
"""Fewer points may lie together."""

SMALL, IMPOSSIBLE = 0.1, 0.05
"""Shares of the format below which points are warned of, and are an error."""

BEYOND = 2.0
"""Points so many times farther out than the marks or the edge are in another unit."""

REMEDY = "check the unit of the image coordinates: `image_coordinates` of the camera, pixel size, all lengths in mm"


def coverage(cameras: Cameras, camera_of_ray: Int, xy_mm: Float) -> tuple[list[InputError], list[Note]]:
    """What image points of each camera say of the unit of their coordinates.

    Parameters
    ----------
    cameras : Cameras
        Half the format, or where its marks lie.
    camera_of_ray : (k,) int
    xy_mm : (k, 2) float64, mm
        From the middle of the image.
    """
    errors, notes = list[InputError](), list[Note]()
    for k, name in enumerate(cameras.id):
        xy = xy_mm[camera_of_ray == k]
        if len(xy) < FEWEST:
            continue
        size, reach = np.ptp(xy, axis=0), float(np.linalg.norm(xy, axis=1).max())
        half = cameras.half_format_mm[k]
        where = f"camera {name}"
        if not np.isfinite(half).all():
            notes += _spanned(where, reach, float(cameras.principal_distance_mm[k]))
            continue
        share = float((size / (2 * half)).max())
        text = f"its {len(xy)} image points lie within {size[0]:.3g} x {size[1]:.3g} mm of each other, {share:.1g} of "
        text += f"the {2 * half[0]:.4g} x {2 * half[1]:.4g} mm of the image"
        if share < IMPOSSIBLE:
            errors.append(InputError(text, where=where, remedy=REMEDY))
        elif share < SMALL:
            notes.append(Note("warning", f"{where}: {text} ({REMEDY})"))
        elif reach > BEYOND * float(np.linalg.norm(half)):
            text = f"image points lie up to {reach:.4g} mm from the middle of the image, which is {half[0]:.4g} x "
            errors.append(InputError(f"{text}{half[1]:.4g} mm in half", where=where, remedy=REMEDY))
    return errors, notes


def _spanned(where: str, reach_mm: float, c_mm: float) -> list[Note]:
    field = float(np.degrees(2 * np.arctan(reach_mm / c_mm)))
    if FIELD_OF_VIEW_DEG[0] <= field <= FIELD_OF_VIEW_DEG[1]:
        return [Note("note", f"{where}, as given: its image points span {field:.3g} deg")]
    return [Note("warning", f"{where}: its image points span {field:.3g} deg: principal distance ({c_mm:.6g} mm) or "
                 f"image coordinates (up to {reach_mm:.4g} mm from the middle) are in another unit")]  # fmt: skip
