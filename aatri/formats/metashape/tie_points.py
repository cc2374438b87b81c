"""Tie points of a `.psz`: PLY files of the points, and of their projections in each image, that its document names.

    points        x y z id        of the points that Metashape has taken for valid, in the chunk
    projections   x y id          of one image, px from the upper left corner; id is that of the point

Projections of tracks without a point are what Metashape has rejected, and are left out.

Source: documents of PhotoScan 1.2 as DBAT (Boerlin and Grussenmeyer) reads them; Turk 1994, The PLY file format.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.text.archive import Archive
from aatri.formats.text.xml_tree import XmlElement

PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
             "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
             "float32": "f4", "float64": "f8"}  # fmt: skip
ENDS = {"binary_little_endian": "<", "binary_big_endian": ">"}
REMEDY = "save the project again as .psz"


class TiePoints(NamedTuple):
    """Tie points: names and coordinates in the chunk (p, 3), and rows image, point, column and row in px."""

    names: list[str]
    xyz: Float
    images: list[str]
    points: list[str]
    xy_px: Float


def tie_points_of(archive: Archive, chunk: XmlElement, images: dict[str, str]) -> TiePoints | None:
    """The tie points of the first frame; None if the archive has none.

    Parameters
    ----------
    images : mapping of str to str
        Names of the enabled images by their ids.

    Raises
    ------
    InputError
        If a file that the document names is not there, or no PLY.
    """
    frames = chunk.all("frames", "frame")
    clouds = frames[0].all("point_cloud") if frames else chunk.all("point_cloud")
    stated = clouds[0].optional("points") if clouds else None
    if stated is None or not stated.get("path"):
        return None
    points = _vertices(archive, stated.get("path"), ("x", "y", "z", "id"))
    placed_ids = points["id"].astype(np.int64)
    named, rows, xy = list[str](), list[npt.NDArray[np.int64]](), list[Float]()
    for element in clouds[0].all("projections"):
        image = images.get(element.get("camera_id"))
        if image is None:
            continue
        seen = _vertices(archive, element.get("path"), ("x", "y", "id"))
        ids = seen["id"].astype(np.int64)
        of_point = np.isin(ids, placed_ids)
        named += [image] * int(of_point.sum())
        rows.append(ids[of_point])
        xy.append(np.column_stack([seen["x"][of_point], seen["y"][of_point]]).astype(np.float64))
    ids = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
    xyz = np.column_stack([points[axis] for axis in "xyz"]).astype(np.float64)
    places = np.concatenate(xy) if xy else np.zeros((0, 2))
    return TiePoints([_name(i) for i in placed_ids.tolist()], xyz, named, [_name(i) for i in ids.tolist()], places)


def _name(number: int) -> str:
    return f"tie {number}"


def _vertices(archive: Archive, name: str, properties: tuple[str, ...]) -> npt.NDArray[Any]:
    """The vertices of a PLY file of the archive, by the names of their properties."""
    data, where = archive.bytes_of(name), archive.at(name)
    head, mark, body = data.partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    if not mark or lines[:1] != [["ply"]]:
        raise _error(where, "this is no PLY file")
    count, fields, order, element = 0, list[tuple[str, str]](), "", ""
    for words in lines[1:]:
        if words[:1] == ["format"] and len(words) == 3:
            order = ENDS.get(words[1], "")
        elif words[:1] == ["element"] and len(words) == 3:
            if element:
                break
            element, count = words[1], int(words[2]) if words[2].isdigit() else -1
        elif words[:1] == ["property"]:
            if len(words) != 3 or words[1] not in PLY_TYPES:
                raise _error(where, f"a property {' '.join(words[1:])}")
            fields.append((words[2], order + PLY_TYPES[words[1]]))
    names = [field for field, _ in fields]
    if element != "vertex" or not order or not {*properties} <= {*names} or len({*names}) < len(names):
        raise _error(where, f"no binary vertices with {', '.join(properties)}")
    dtype = np.dtype(fields)
    if count < 0 or len(body) < count * dtype.itemsize:
        raise _error(where, f"{len(body)} bytes, where {count} vertices need {count * dtype.itemsize}")
    return np.frombuffer(body, dtype, count)


def _error(where: Path, what: str) -> InputError:
    return InputError(what, where=str(where), remedy=REMEDY)
