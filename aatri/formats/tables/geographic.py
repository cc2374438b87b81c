"""A block whose first frame is in latitude, longitude and height: a map of its own comes before it.

The block is then in the UTM zone of its middle, on the same datum and with the same heights; rows without `frame` stay
in the declared one. What is counted in the axes of the first frame has none in degrees, and is refused by name.

Of coordinates that look like those of a map in a frame that is declared local is asked, since the earth bends a map.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.errors import AatriError, Errors, Faults, InputError
from aatri.formats.tables.columns import TABLES
from aatri.formats.tables.settings.block import FrameSettings
from aatri.formats.tables.source import Source
from aatri.formats.text.csv_table import read_csv
from aatri.frames.checks import out_of_range
from aatri.frames.conversion import Frame
from aatri.frames.own_map import utm_of

WITH_COORDINATES = ("ground_points.csv", "exterior.csv")


def with_metric_frame(source: Source) -> Source:
    """The source with a map as its first frame, where that is geographic."""
    settings = source.settings
    name, first = next(iter(settings.frames.items()))
    if "latitude" not in first.axes:
        return source
    declared = Frame(name, tuple(first.axes), first.crs, first.vertical)
    place = _middle(source, declared)
    if place is None:
        raise InputError(
            f"frame {name} is in latitude and longitude, and no row of ground_points.csv or exterior.csv has both",
            where=source.document.where("frames", name),
            remedy="give coordinates, or make a frame in metres the first one",
        )
    own = utm_of(declared, *place)
    called = own.name
    while called in settings.frames:
        called += "_"
    if settings.heading == "grid":
        raise InputError(
            "headings count from the grid, but the first frame is in latitude and longitude",
            where=source.document.where("heading"),
            remedy="write heading: true, or make the map the first frame",
        )
    frame = FrameSettings(axes=list(own.axes), crs=own.crs, vertical=own.vertical)
    source.reporter.log(f"frame {name} is in latitude and longitude: the block is in {called} ({_called(own)})")
    settings = settings.model_copy(update={"frames": {called: frame, **settings.frames}})
    return replace(source, settings=settings, default_frame=1)


def _middle(source: Source, frame: Frame) -> tuple[float, float] | None:
    """Middle latitude and longitude of the rows in the first frame, degrees."""
    plans = []
    for name in WITH_COORDINATES:
        try:
            table = read_csv(source.folder / name, {column: s.cell for column, s in TABLES[name].items()}, Faults())
        except (Errors, AatriError):
            continue  # its faults are told where the table is read
        xyz = np.stack([table.number[c] for c in ("X", "Y", "Z")], axis=1)
        xyz = xyz[np.array([cell in ("", frame.name) for cell in table.text["frame"]], dtype=bool)]
        plan = xyz[:, [frame.axes.index("latitude"), frame.axes.index("longitude")]]
        good = np.isfinite(plan).all(axis=1) & ~out_of_range(np.nan_to_num(xyz), frame.axes)
        plans.append(plan[good])
    rows = np.concatenate([np.zeros((0, 2)), *plans])
    if not len(rows):
        return None
    return float(np.median(rows[:, 0])), float(np.median(rows[:, 1]))


def _called(own: Frame) -> str:
    """What messages call the map: its code, or that it has none."""
    return own.crs if len(own.crs) < 20 else "no code, its definition is in the block"


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
