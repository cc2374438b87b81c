"""Coordinates that look like those of a map, in a frame that is declared local: asked, since the earth bends a map."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from aatri.formats.tables.source import Source

EASTING_M, NORTHING_M = (100_000.0, 900_000.0), (100_000.0, 10_000_000.0)
"""Where coordinates of UTM zones and of grids made alike lie (NGA.SIG.0012, 2014: eastings from 167 km to 833 km at the
equator, false northing 10,000 km); local systems begin near zero."""


def map_or_not(source: Source, ground_points: Mapping[str, Any]) -> str:
    """The question, where a local frame has coordinates of a map and `earth_curvature` is not stated; else empty.

    Parameters
    ----------
    ground_points : mapping
        Columns of the known points.
    """
    name, frame = next(iter(source.settings.frames.items()))
    if frame.crs != "local" or source.settings.earth_curvature is not None:
        return ""
    if not {"east", "north"} <= set(frame.axes):
        return ""
    xyz_m = np.asarray(ground_points.get("xyz_m", ()), dtype=np.float64).reshape(-1, 3)
    en_m = xyz_m[:, [0, 1]]  # right-handed by now: east, north
    en_m = en_m[np.isfinite(en_m).all(axis=1)]
    if not len(en_m):
        return ""
    low, high = np.array([EASTING_M, NORTHING_M]).T
    if not ((en_m > low) & (en_m < high)).all():
        return ""
    where = source.document.where("frames", name, "crs")
    east, north = en_m.mean(axis=0)
    return (
        f"{where}: is this a map? Its coordinates look like it (E {east:.0f} m, N {north:.0f} m), but crs is local, "
        "which is taken as Cartesian, and the earth bends a map; if it is one, write its crs (EPSG:32650 ...), if not, "
        "write earth_curvature: ignore"
    )
