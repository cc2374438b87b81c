"""What is wrong with a declared frame: an unknown code, axes that are not those of its CRS, figures out of range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.arrays import Bool, Float
from aatri.frames.conversion import Frame
from aatri.frames.heights import is_tangent_frame

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
        system = pyproj.CRS.from_user_input(frame.crs)
    except pyproj.exceptions.CRSError as error:
        return (
            "crs",
            f"crs {frame.crs!r} is not known: {_short(error)}",
            "write it as EPSG:32650, PROJ or WKT text, or local",
        )
    if frame.vertical:
        try:
            vertical = pyproj.CRS.from_user_input(frame.vertical)
        except pyproj.exceptions.CRSError as error:
            return "vertical", f"vertical {frame.vertical!r} is not known: {_short(error)}", "write it as EPSG:5773"
        if not vertical.is_vertical:
            return (
                "vertical",
                f"vertical {frame.vertical} is {vertical.name}, no vertical system",
                "name a height system",
            )
    geographic = set(frame.axes) == set(GEOGRAPHIC)
    if system.is_geographic and not geographic:
        what = f"{frame.crs} ({system.name}) is geographic, in degrees, but the axes are {', '.join(frame.axes)}"
        return "axes", what, "write axes: [latitude, longitude, height], or the projected CRS of the coordinates"
    if geographic and not system.is_geographic:
        what = f"the axes are {', '.join(frame.axes)}, but {frame.crs} ({system.name}) is not geographic"
        return "axes", what, "write axes: [east, north, up], or a geographic CRS such as EPSG:4979"
    return None


def out_of_range(xyz: Float, axes: Sequence[str]) -> Bool:
    """Rows whose latitude is beyond 90 or longitude beyond 360 degrees, (n,); none in frames of metres."""
    if set(axes) != set(GEOGRAPHIC):
        return np.zeros(len(xyz), dtype=bool)
    latitude, longitude = xyz[:, axes.index("latitude")], xyz[:, axes.index("longitude")]
    return np.asarray((np.abs(latitude) > 90) | (np.abs(longitude) > 360))


def _short(error: Exception) -> str:
    return str(error).splitlines()[0].rstrip(": ")
