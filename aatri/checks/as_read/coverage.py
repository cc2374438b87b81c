"""What the image points of a camera cover of its format: all of them in a corner, or beyond its marks, is a wrong unit.

    share = largest extent of the points of all images / format,     reach = largest distance from the middle
    imprecision = median standard deviation of the better coordinate / largest extent

Seen: millimetres read as micrometres, inches as millimetres, pixels as millimetres shrink or blow up the bundle of
rays, which some adjustments survive with another principal distance.
Test: a share below a twentieth, or a reach beyond twice the half diagonal: of the format, where ten times as large it
holds points that span an angle as cameras have. All points in one quarter, which they fill, are a warning: the format
is too large, or the origin another. Where neither format nor marks are given, the angle 2 atan(reach / c) that the
points span must be one that a camera has; the units are named in which it would.
An imprecision of more than 0.008 is a warning: it may be a target in the middle of all images, or a camera of little
weight. It is an error where all cameras are so and the standard deviation would be a usual one in a smaller unit. One
below a fiftieth of a pixel, or a millionth of the extent of film, is a warning: no measurement is as exact.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.checks.as_read.cameras import CameraFrames
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import (
    BEYOND_FORMAT,
    FEWEST_COVERING,
    FIELD_OF_VIEW_DEG,
    FILLED,
    IMPRECISE,
    MOST_EXACT,
    MOST_EXACT_PX,
    NO_COVERAGE,
    SMALL_COVERAGE,
    USUAL_FIELD_DEG,
    USUAL_SIGMA_MM,
)

UNITS_MM = {"0.1 um": 1e-4, "um": 1e-3, "0.01 mm": 1e-2, "cm": 10.0, "inches": 25.4, "m": 1000.0}
"""Units in which photo coordinates are met with, other than mm."""

REMEDY = "check the unit of the image coordinates: `image_coordinates` of the camera, pixel size, all lengths in mm"
FORMAT_REMEDY = "check `format` of the camera, in mm for film, in pixels for digital images"
SIGMA_REMEDY = "check `sigma: {image: ...}`, the columns sx and sy, and their unit `units.sigma_image`"


def coverage(cameras: CameraFrames, camera_of_ray: Int, xy_mm: Float) -> list[Finding]:
    """What image points of each camera say of the unit of their coordinates.

    Parameters
    ----------
    cameras : CameraFrames
        Half the format, or where its marks lie.
    camera_of_ray : (k,) int
    xy_mm : (k, 2) float64, mm
        From the middle of the image.
    """
    findings = []
    for k, name in enumerate(cameras.id):
        xy, half, c = xy_mm[camera_of_ray == k], cameras.half_format_mm[k], float(cameras.principal_distance_mm[k])
        if len(xy) < FEWEST_COVERING:
            continue
        size, reach = np.ptp(xy, axis=0), float(np.linalg.norm(xy, axis=1).max())
        level: Level = "note"
        remedy = REMEDY
        share = float((size / (2 * half)).max())
        field = float(np.degrees(2 * np.arctan(reach / c)))
        text = f"its {len(xy)} image points span {field:.3g} deg, up to {reach:.4g} mm from the middle of the image"
        if not np.isfinite(half).all():
            if not FIELD_OF_VIEW_DEG[0] <= field <= FIELD_OF_VIEW_DEG[1]:
                level, text = "warning", f"{text}: as no lens does{_other_unit(reach, c)}"
                text += ", and all in one quarter, as pixels from a corner do" if _in_one_quarter(xy) else ""
        elif share < SMALL_COVERAGE:
            level = "error" if share < NO_COVERAGE else "warning"
            text = (
                f"its {len(xy)} image points lie within {size[0]:.3g} x {size[1]:.3g} mm of each other, {share:.1g} of "
            )
            text += f"the {2 * half[0]:.4g} x {2 * half[1]:.4g} mm of the image"
        elif reach > BEYOND_FORMAT * float(np.linalg.norm(half)):
            level, text = "error", f"{text}, which is {half[0]:.4g} x {half[1]:.4g} mm in half"
            if reach < 10 * float(np.linalg.norm(half)) and USUAL_FIELD_DEG[0] <= field <= USUAL_FIELD_DEG[1]:
                remedy = FORMAT_REMEDY + "; ten times as large it holds them"
        elif _in_one_quarter(xy) and (size > FILLED * half).all():
            level, remedy = "warning", FORMAT_REMEDY + ", and `origin` of the pixels"
            text = f"its {len(xy)} image points all lie in one quarter of the image, and fill it"
        else:
            continue
        findings.append(Finding("coverage", level, text, remedy * (level != "note"), where=f"camera {name}"))
    return findings


def _in_one_quarter(xy_mm: Float) -> bool:
    return bool(((xy_mm < 0).all(axis=0) | (xy_mm > 0).all(axis=0)).all())


def imprecision(cameras: CameraFrames, camera_of_ray: Int, xy_mm: Float, sigma_mm: Float) -> list[Finding]:
    """Standard deviations of image points that are no small part of the image: they are in another unit.

    Parameters
    ----------
    camera_of_ray : (k,) int
    xy_mm, sigma_mm : (k, 2) float64, mm
    """
    measured, imprecise, findings = 0, [], list[Finding]()
    for k, name in enumerate(cameras.id):
        xy, sigma = xy_mm[camera_of_ray == k], sigma_mm[camera_of_ray == k]
        extent = float(np.ptp(xy, axis=0).max()) if len(xy) >= FEWEST_COVERING else 0.0
        if extent == 0.0:  # all in one place: `coverage` tells that
            continue
        measured += 1
        median = float(np.median(sigma.min(axis=1)))  # a coordinate that is not measured has a large one
        if median > IMPRECISE * extent:
            imprecise.append((name, median, extent))
        findings += _too_exact(name, median, extent, float(cameras.pixel_mm[k]))
    for name, median, extent in imprecise:
        units = _usual_units(median) if len(imprecise) == measured else []
        text = f"standard deviations of its image points are {median:.3g} mm in the median, {median / extent:.1%} of "
        text += f"the {extent:.4g} mm over which the points lie"
        text += "".join(f"; in units of {unit} {1e3 * UNITS_MM[unit] * median:.3g} um" for unit in units)
        level: Level = "error" if units else "warning"
        findings.append(Finding("coverage", level, text, SIGMA_REMEDY, where=f"camera {name}"))
    return findings


def _too_exact(name: str, sigma_mm: float, extent_mm: float, pixel_mm: float) -> list[Finding]:
    """Standard deviations that no measurement has: in another unit, or guessed."""
    size_mm, least, of_what = extent_mm, MOST_EXACT, "the image"
    if pixel_mm > 0:
        size_mm, least, of_what = pixel_mm, MOST_EXACT_PX, "a pixel"
    if not 0 < sigma_mm < least * size_mm:
        return []
    text = f"standard deviations of its image points are {1e3 * sigma_mm:.2g} um in the median, "
    text += f"{sigma_mm / size_mm:.2g} of {of_what}: no measurement is as exact, and residuals will not fit them"
    return [Finding("coverage", "warning", text, SIGMA_REMEDY, where=f"camera {name}")]


def _usual_units(sigma_mm: float) -> list[str]:
    """Units smaller than mm in which a standard deviation would be a usual one that in mm is none."""
    least, most = USUAL_SIGMA_MM
    return [u for u, mm in UNITS_MM.items() if sigma_mm > most and mm < 1.0 and least <= mm * sigma_mm <= most]


def _other_unit(reach_mm: float, c_mm: float) -> str:
    """What the angle would be where millimetres are another unit that has been read as millimetres."""
    fields = {unit: float(np.degrees(2 * np.arctan(mm * reach_mm / c_mm))) for unit, mm in UNITS_MM.items()}
    usual = [unit for unit, field in fields.items() if USUAL_FIELD_DEG[0] <= field <= USUAL_FIELD_DEG[1]]
    if not usual:
        return ""
    return "; " + ", ".join(f"in units of {unit} {fields[unit]:.0f} deg" for unit in usual)
