"""Ground points (`.gpf`) and image points (`.ipf`) of SOCET SET and SOCET GXP.

    GROUND POINT FILE                              IMAGE POINT FILE
    [key value ...]            of GXP alone        count
    count                                          names of the columns
    names of the columns                           point valid fiducial observations
    point used kind                                line sample             px from the image centre, y down
    latitude|Y longitude|X height                  sigma_l sigma_s
    sX sY sZ                                       residuals
    residuals                                      fiducial coordinates
    [3 lines of eigenvalues]   of GXP alone        a blank line after each point

Latitudes and longitudes are in radians in SOCET SET, in degrees in GXP where `GXP_XY_UNITS` is 8; in other files the
coordinates are Y and X of a grid, m. Kind 0 is a tie point; control of height is 1, of X and Y 2, of all three 3; 4 to
6 are check points likewise. So the samples have it: points called `_z` are of kind 1 and have sigmas 0 0 2, those
called `_xyz` of kind 3 with 2 2 1, and the one of kind 6 has residuals of hundreds of metres. A standard deviation of 0
is not stated. An image is called by its `.ipf`. Points that are not used or not valid are left out.

Sources: DOI-USGS/plio (reader and samples with their contents); SOCET SET user's manual.
"""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aatri.codes import APPROXIMATE, CHECK, CONTROL
from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Format, Reading, begins
from aatri.formats.text.text_line import TextLine, places, word_lines
from aatri.frames.conversion import Frame
from aatri.ids import several
from aatri.progress import SILENT, Reporter

DEGREES = "8"
"""`GXP_XY_UNITS` of degrees."""

A, K, P = APPROXIMATE, CONTROL, CHECK
KINDS = {0: (A, A, A), 1: (A, A, K), 2: (K, K, A), 3: (K, K, K), 4: (A, A, P), 5: (P, P, A), 6: (P, P, P)}
"""Roles of X, Y, Z by the kind of a point."""

EXPORT = "the file is incomplete or was changed by hand: export it again"


class SocetPoint(NamedTuple):
    """A point of either file: its line, its id, the whole numbers behind it, the numbers of the lines below."""

    at: TextLine
    id: str
    flags: list[int]
    rows: list[list[float]]


def read_points(
    path: Path, title: str, flags: int, widths: tuple[int, ...], reporter: Reporter = SILENT
) -> tuple[dict[str, TextLine], list[SocetPoint]]:
    """The header and the points of a file.

    Parameters
    ----------
    title : str
        Its first line.
    flags : int
        Whole numbers behind the id.
    widths : tuple of int
        Numbers in the lines that each point has at least.

    Raises
    ------
    InputError
        If the file is not of this form, has other points than it counts, or a point twice.
    """
    lines = word_lines(path, reporter)
    if " ".join(lines[0].words) != title:
        raise lines[0].error(f"the first line is not {title!r}", f"give a file of SOCET that begins with {title}")
    at = next((k for k, line in enumerate(lines[1:], 1) if re.fullmatch("[0-9]{1,8}", " ".join(line.words))), None)
    if at is None or at + 1 >= len(lines):
        raise lines[-1].error("the number of points is not there", EXPORT)
    header = {line.words[0]: line for line in lines[1:at]}
    count, points, k, first = lines[at].count(0), list[SocetPoint](), at + 2, dict[str, TextLine]()
    while k < len(lines):
        head, below = lines[k], lines[k + 1 : k + 1 + len(widths)]
        if len(head.words) != flags + 1:
            what = f"{several(len(head.words), 'word')} where a point should begin"
            raise head.error(what, f"write its id and {flags} numbers")
        if len(below) < len(widths):
            raise head.error(f"point {head.words[0]} ends early", EXPORT)
        rows = [line.of_width(n, f"{n} numbers of point {head.words[0]}").numbers() for line, n in zip(below, widths)]
        head.once(head.words[0], first, "point")
        points.append(SocetPoint(head, head.words[0], [head.count(j) for j in range(1, flags + 1)], rows))
        k += 1 + len(widths)
        while k < len(lines) and len(lines[k].words) == 4 and flags == 2:  # eigenvalues and their vectors
            rows.append(lines[k].numbers())
            k += 1
    if len(points) != count:
        raise lines[at].error(f"{several(count, 'point', 'is', 'are')} announced, {len(points)} are there", EXPORT)
    if not any(point.flags[0] for point in points):
        raise lines[at].error(f"none of {count} points is used", "give a file with points that are switched on")
    return header, points


def read_gpf(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read ground points.

    Parameters
    ----------
    reading : Reading
        Its `crs` is the coordinate system of the points, where the file does not say it.

    Raises
    ------
    InputError
        As `read_points`; or if a kind of point is not known, or geographic coordinates have no datum.
    """
    header, points = read_points(path, "GROUND POINT FILE", 2, (3, 3, 3), reporter)
    used = [point for point in points if point.flags[0]]
    for point in points:
        if point.flags[1] not in KINDS:
            raise point.at.error(f"point {point.id} is of kind {point.flags[1]}", "known are 0 to 6")
    yxz = np.array([point.rows[0] for point in points]).reshape(-1, 3)
    degrees = "GXP_XY_UNITS" in header and header["GXP_XY_UNITS"].words[1:] == [DEGREES]
    inside = (np.abs(yxz[:, :2]) <= [math.pi / 2, 2 * math.pi]).all(axis=1)
    radians = not header and bool(inside.any())
    if radians and not inside.all():
        odd = points[int(np.flatnonzero(~inside)[0])]
        what = f"point {odd.id} is at {odd.rows[0][0]:g}, {odd.rows[0][1]:g}, others at radians"
        raise odd.at.error(what, "latitude and longitude of all points are radians, or all are of a grid")
    scale = math.degrees(1) if radians else 1.0
    sigma = np.array([point.rows[1] for point in used]).reshape(-1, 3)[:, [1, 0, 2]]
    role = np.array([KINDS[point.flags[1]] for point in used]).reshape(-1, 3)
    place = np.array([point.rows[0] for point in used]).reshape(-1, 3)[:, [1, 0, 2]] * [scale, scale, 1.0]
    return BlockParts(
        "socet_gpf",
        [path],
        name=path.stem,
        frame=_geographic(header, reading.crs, points[0], "degrees" if degrees else "radians")
        if degrees or radians
        else PLANE,
        notes=[f"{several(len(points) - len(used), 'point', 'is', 'are')} not used"] if len(used) < len(points) else [],
        ground_points={
            "point": [point.id for point in used],
            "xyz_m": place,
            "sigma_m": np.where(role == APPROXIMATE, 0.0, np.where(sigma > 0, sigma, np.nan)),
            "role": role,
            **places([point.at for point in used], [path]),
        },
    )


def read_ipf(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read image points; the image is called as the file.

    Raises
    ------
    InputError
        As `read_points`.
    """
    _, points = read_points(path, "IMAGE POINT FILE", 3, (2, 2, 2, 2), reporter)
    valid = [point for point in points if point.flags[0]]
    sigma = np.array([point.rows[1] for point in valid]).reshape(-1, 2)[:, ::-1]
    return BlockParts(
        "socet_ipf",
        [path],
        name=path.stem,
        pixel_axes=PIXEL_AXES["socet"],
        notes=[f"{several(len(points) - len(valid), 'point', 'is', 'are')} not valid"]
        if len(valid) < len(points)
        else [],
        image_points={
            "image": path.stem,
            "point": [point.id for point in valid],
            "xy": [point.rows[0][::-1] for point in valid],
            "sigma_px": np.where(sigma > 0, sigma, np.nan),
            **places([point.at for point in valid], [path]),
        },
    )


def _geographic(header: dict[str, TextLine], crs: str | None, first: SocetPoint, unit: str) -> Frame:
    """Longitude, latitude, height on what is said, or on the ellipsoid of the header."""
    crs = crs or _on_ellipsoid(header)
    if crs is None:
        latitude, longitude, _ = first.rows[0]
        place = f"point {first.id} is at latitude {latitude:.6g}, longitude {longitude:.6g} {unit}"
        what = f"{place}, and no line of the file names the ellipsoid"
        raise first.at.error(what, f"say its coordinate system: {_proposal(first.at.path)}")
    return Frame("socet", ("longitude", "latitude", "height"), crs)


def _on_ellipsoid(header: dict[str, TextLine]) -> str | None:
    """Longitude and latitude on the ellipsoid that A_EARTH, m, and E_EARTH, its first eccentricity, state."""
    if not {"A_EARTH", "E_EARTH"} <= header.keys():
        return None
    a, e = header["A_EARTH"].number(1), header["E_EARTH"].number(1)
    if a <= 0 or not 0 <= e < 1:
        raise header["E_EARTH"].error(f"an ellipsoid of A_EARTH {a:g}, E_EARTH {e:g}", "a > 0 in m, 0 <= e < 1")
    return f"+proj=longlat +a={a!r} +b={a * math.sqrt(1 - e * e)!r} +no_defs +type=crs"


def _proposal(path: Path) -> str:
    """How to say the ellipsoid: that of a project of SOCET beside the file, where there is one."""
    for project in sorted(path.parent.glob("*.prj")):
        try:
            crs = _on_ellipsoid({line.words[0]: line for line in word_lines(project)})
        except InputError:
            continue
        if crs is not None:
            return (
                f'as {project.name} beside it has it, `--set "crs={crs}"`, in a pipeline `crs: {crs}` beside the path'
            )
    of_mars = "crs=+proj=longlat +a=3396190 +b=3376200 +no_defs +type=crs"
    return f'on Earth `--set crs=EPSG:4979`, on Mars `--set "{of_mars}"`, in a pipeline `crs:` beside the path'


PAGE = "docs/formats.md#socet"


GPF = Format(
    "socet_gpf",
    "SOCET ground points (.gpf)",
    begins("GROUND POINT FILE"),
    "a first line GROUND POINT FILE",
    carries=("control", "start values of points", "standard deviations", "frame"),
    page=PAGE,
    read=read_gpf,
)
IPF = Format(
    "socet_ipf",
    "SOCET image points (.ipf)",
    begins("IMAGE POINT FILE"),
    "a first line IMAGE POINT FILE",
    carries=("image points", "standard deviations"),
    page=PAGE,
    read=read_ipf,
)
