"""What is wrong with a declared frame: an unknown code, axes that are not those of its CRS, figures out of range."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from aatri.arrays import Bool, Float
from aatri.frames.conversion import Frame
from aatri.frames.crs_text import crs_from
from aatri.frames.heights import is_tangent_frame
from aatri.frames.limits import OUTSIDE_DEG

GEOCENTRIC = ("x", "y", "z")
GEOGRAPHIC = ("latitude", "longitude", "height")


def fault_of_frame(frame: Frame) -> tuple[str, str, str] | None:
    """What is wrong with the CRS of a frame: the key (crs, vertical or axes), what, and the remedy; None if nothing.

    Parameters
    ----------
    frame : Frame
        With `local` nothing is checked; a tangent frame (`+proj=topocentric`) has no axes of its own.
    """
    if frame.crs == "local" or is_tangent_frame(frame.crs):
        return None
    import pyproj

    try:
        system = crs_from(frame.crs)
    except pyproj.exceptions.CRSError as error:
        return (
            "crs",
            f"crs {frame.crs!r} is not known: {_short(error)}",
            "write it as EPSG:32650, PROJ or WKT text, or local",
        )
    if frame.vertical:
        try:
            vertical = crs_from(frame.vertical)
        except pyproj.exceptions.CRSError as error:
            return "vertical", f"vertical {frame.vertical!r} is not known: {_short(error)}", "write it as EPSG:5773"
        if not vertical.is_vertical:
            return (
                "vertical",
                f"vertical {frame.vertical} is {vertical.name}, no vertical system",
                "name a height system",
            )
        if fault := _other_units(frame.vertical, vertical):
            return "vertical", *fault
    if system.is_vertical and not system.is_compound:
        return "crs", f"{frame.crs} is {system.name}, a system of heights alone", "write it under vertical"
    if system.is_geocentric and set(frame.axes) != set(GEOCENTRIC):
        what = f"{frame.crs} ({system.name}) is geocentric, but the axes are {', '.join(frame.axes)}"
        return "axes", what, "write axes: [x, y, z], or the projected CRS of the coordinates"
    if fault := _other_units(frame.crs, system):
        return "crs", *fault
    geographic = set(frame.axes) == set(GEOGRAPHIC)
    if system.is_geographic and not geographic:
        what = f"{frame.crs} ({system.name}) is geographic, in degrees, but the axes are {', '.join(frame.axes)}"
        return "axes", what, "write axes: [latitude, longitude, height], or the projected CRS of the coordinates"
    if geographic and not system.is_geographic:
        what = f"the axes are {', '.join(frame.axes)}, but {frame.crs} ({system.name}) is not geographic"
        return "axes", what, "write axes: [east, north, up], or a geographic CRS such as EPSG:4979"
    return None


def _other_units(code: str, system: Any) -> tuple[str, str] | None:
    """What and remedy, of a system that does not count in metres and degrees, upwards."""
    for axis in system.axis_info:
        angle = axis.direction in ("north", "east", "south", "west") and system.is_geographic
        expected = np.pi / 180 if angle and "height" not in axis.name else 1.0
        if abs(axis.unit_conversion_factor / expected - 1) > 1e-12:
            what = f"{code} ({system.name}) counts {axis.name.lower()} in {axis.unit_name}; here coordinates are in "
            what += "degrees" if angle else "metres"
            return what, "convert the coordinates, and name the same system in that unit"
        if axis.direction == "down":
            return f"{code} ({system.name}) counts downwards", "turn the sign, and name a system of heights"
    return None


def place_outside(frame: Frame, xyz: Float) -> str:
    """Where coordinates lie if that is far from where their CRS is used; empty where it is not, or cannot be told.

    Parameters
    ----------
    xyz : (n, 3) float64, m
        East, north, up; NaN where not known.
    """
    import pyproj

    system = crs_from(frame.crs)
    flat = system.sub_crs_list[0] if system.is_compound else system.to_2d()
    area = system.area_of_use or flat.area_of_use
    plan = xyz[np.isfinite(xyz[:, :2]).all(axis=1), :2]
    if not flat.is_projected or area is None or not len(plan):
        return ""
    to_degrees = pyproj.Transformer.from_crs(flat, flat.geodetic_crs, always_xy=True)
    longitude, latitude = to_degrees.transform(*np.median(plan, axis=0))
    across = (area.east - area.west) % 360 or 360.0
    on_earth = bool(np.isfinite([longitude, latitude]).all())
    place = f"at latitude {latitude:.1f}, longitude {longitude:.1f} deg" if on_earth else "nowhere on the earth"
    within = on_earth and area.south - OUTSIDE_DEG <= latitude <= area.north + OUTSIDE_DEG
    if within and (across > 350 or (longitude - area.west + OUTSIDE_DEG) % 360 <= across + 2 * OUTSIDE_DEG):
        return ""
    used = area.name.split(". ")[0].rstrip(".")
    return f"in {frame.crs} ({system.name}) the block lies {place}, far from where that is used ({used})"


def out_of_range(xyz: Float, axes: Sequence[str]) -> Bool:
    """Rows whose latitude is beyond 90 or longitude beyond 360 degrees, (n,); none in frames of metres."""
    if set(axes) != set(GEOGRAPHIC):
        return np.zeros(len(xyz), dtype=bool)
    latitude, longitude = xyz[:, axes.index("latitude")], xyz[:, axes.index("longitude")]
    return np.asarray((np.abs(latitude) > 90) | (np.abs(longitude) > 360))


def _short(error: Exception) -> str:
    return str(error).splitlines()[0].rstrip(": ")
