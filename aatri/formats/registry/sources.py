"""Reading of a source: its format is recognised or named, and what was said of it is applied."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.codes import APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.checked import check_parts
from aatri.formats.parts.format import Reading
from aatri.formats.parts.geoid import with_ellipsoidal_heights
from aatri.formats.registry.recognised import Recognised, format_named, recognised, recognised_file
from aatri.formats.text.text_file import missing
from aatri.frames.checks import fault_of_frame
from aatri.frames.conversion import Frame
from aatri.ids import shown
from aatri.progress import Reporter

TABLES = {
    "cameras": ("cameras", "camera_parameters"),
    "image points": ("image_points",),
    "ground points": ("ground_points",),
    "positions": ("exterior",),
    "attitudes": ("exterior",),
}
"""What may be taken of a source, and the tables it is in; the images themselves are always."""

OF_POSITIONS = ("position_m", "sigma_m", "position_covariance_m2", "position_use", "refers_to", "drift_group")
OF_ATTITUDES = ("angles_rad", "ground_from_image", "angle_sigma_rad", "angle_use")


def read_source(
    path: Path, reading: Reading, reporter: Reporter, *, format: str | None = None, geoid: Path | None = None
) -> BlockParts:
    """What a file or folder gives.

    Parameters
    ----------
    path : Path
    reading : Reading
    reporter : Reporter
    format : str, optional
        Its name; None: a list where `reading` names columns, else recognised by the content.
    geoid : Path, optional
        Grid of the geoid above which its heights are.

    Raises
    ------
    InputError
        If the format is not known or the source not of its form.
    """
    if not path.exists():
        raise missing(path)
    if format is None and reading.columns is not None:
        format = "table"
    if format is None:
        of = recognised_file(path)
        declared = of.format
        reporter.log(f"{path}: {declared.title} ({of.seen})")
    else:
        declared = format_named(format)
    if declared.read is None:
        what = f"{declared.title} is read by {declared.stage or 'nothing'} alone, not beside other sources"
        raise InputError(what, where=str(path), remedy=f"see {declared.page}")
    parts = declared.read(path, reading, reporter)
    parts = _as_said(parts, reading)
    check_parts(parts)
    return parts if geoid is None else with_ellipsoidal_heights(parts, geoid)


def read_all(paths: Sequence[Path], reading: Reading, reporter: Reporter) -> tuple[list[Recognised], list[BlockParts]]:
    """The sources of some files and folders, and what they give.

    The first one says which images there are (`parts.joined`), so those with most image points' images come first.

    Raises
    ------
    InputError
        If a path is of no known format, or a source not of its form.
    """
    unread = list[Path]()
    found = [source for path in paths for source in recognised(path, unread)]
    for source in found:
        reporter.log(f"{source.path}: {source.format.title} ({source.seen})")
    if unread:
        reporter.log(f"of no known format, not read: {shown([str(path) for path in unread])}")
    if len(found) == 1 and found[0].format.read is None:
        return found, []
    parts = [read_source(s.path, reading, reporter, format=s.format.name) for s in found]
    images = [len({*p.image_points.get("image", ()), *p.images.get("id", ())}) if p.image_points else 0 for p in parts]
    order = sorted(range(len(found)), key=lambda k: -images[k])
    return [found[k] for k in order], [parts[k] for k in order]


def _as_said(parts: BlockParts, reading: Reading) -> BlockParts:
    """The parts in the frame that was said, and with what was said to be observed or not."""
    if reading.crs or reading.vertical:
        parts = replace(parts, frame=_frame(parts, reading))
    exterior = dict(parts.exterior)
    if reading.use is not None and exterior:
        code = OBSERVED_VALUE if reading.use == "observed" else APPROXIMATE_VALUE
        exterior |= {"position_use": code, "angle_use": code}
    takes = reading.take
    if takes:
        for what, tables in TABLES.items():
            if what not in takes and "exterior" not in tables:
                left_out: dict[str, Any] = {name: {} for name in tables}
                parts = replace(parts, **left_out)
        if "positions" not in takes:
            exterior = {name: v for name, v in exterior.items() if name not in OF_POSITIONS}
        if "attitudes" not in takes:
            exterior = {name: v for name, v in exterior.items() if name not in OF_ATTITUDES}
        if not {*exterior} & {"position_m", "angles_rad", "ground_from_image"}:
            exterior = {}
    if exterior and "position_m" not in exterior:
        exterior["position_m"] = np.full((len(exterior["image"]), 3), np.nan)
    return replace(parts, exterior=exterior)


def stated_frame(crs: str | None, vertical: str | None, where: str = "") -> Frame | None:
    """The frame of a coordinate system and a height system; None where there is neither.

    Raises
    ------
    InputError
        If pyproj does not know one of them, or it does not count in metres or degrees.
    """
    if crs is None and vertical is None:
        return None
    frame = Frame("map", _axes(crs or "local"), crs or "local", vertical or "")
    if fault := fault_of_frame(frame):
        key, what, remedy = fault
        raise InputError(f"{key}: {what}", where=where, remedy=remedy)
    return frame


def _frame(parts: BlockParts, reading: Reading) -> Frame | None:
    own = parts.frame
    if reading.crs is None and own is not None and own.crs != "local":
        stated_frame(own.crs, reading.vertical, str(parts.files[0]))
        return replace(own, vertical=reading.vertical or own.vertical)
    return stated_frame(reading.crs, reading.vertical, str(parts.files[0]))


def _axes(crs: str) -> tuple[str, ...]:
    from aatri.frames.crs_text import crs_from

    try:
        system = crs_from(crs)
    except Exception:  # of pyproj; told as a fault of the frame
        return ("east", "north", "up")
    if system.is_geocentric:
        return ("x", "y", "z")
    return ("longitude", "latitude", "height") if system.is_geographic else ("east", "north", "up")
