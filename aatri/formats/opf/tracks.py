"""Tracks of an OPF calibration: a glTF document whose primitives have the extension OPF_mesh_primitive_matches.

    pointIndexRanges   per point two uint32 = 40 bits offset, 24 bits count, little-endian
    cameraIds          per match the row of its camera in cameraUids
    pixelCoordinates   per match column and row, px from the upper left corner

Accessors lead through buffer views to binary files beside the document. What is not told has no standard deviation.

Source: the specification, github.com/Pix4D/opf-spec; Khronos Group, glTF 2.0 specification, section 3.6.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.formats.text.json_text import JsonText, Key
from aatri.formats.text.text_file import read_bytes

EXTENSION = "OPF_mesh_primitive_matches"
COMPONENTS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def read_tracks(path: Path, name_of: dict[int, str], files: list[Path]) -> list[tuple[Any, ...]]:
    """Rows image, point, xy, sigma, file, line of all matches; read files are added to `files`.

    Raises
    ------
    InputError
        If the document or a buffer is not of the specification.
    """
    document = JsonText(path, "the tracks of a calibration, glTF 2.0")
    files.append(path)
    file, rows = len(files) - 1, list[tuple[Any, ...]]()
    for m, _ in enumerate(document.get(list, "meshes")):
        for p, _ in enumerate(document.get(list, "meshes", m, "primitives")):
            of_primitive: tuple[Key, ...] = ("meshes", m, "primitives", p)
            if "extensions" not in document.get(dict, *of_primitive):
                continue
            if EXTENSION not in document.get(dict, *of_primitive, "extensions"):
                continue
            keys: tuple[Key, ...] = (*of_primitive, "extensions", EXTENSION)
            ranges = _accessor(document, (*keys, "pointIndexRanges"), files).astype(np.uint64)
            cameras = _accessor(document, (*keys, "cameraIds"), files)[:, 0].astype(np.intp)
            if document.get(dict, *keys, "imagePoints", default=None) is None:
                raise document.fault(keys, "matches without imagePoints", "export the tracks with their image points")
            xy = _accessor(document, (*keys, "imagePoints", "pixelCoordinates"), files).astype(np.float64)
            number_of_uids = len(document.get(list, *keys, "cameraUids"))
            uids = [document.get(int, *keys, "cameraUids", j) for j in range(number_of_uids)]
            unknown = [uid for uid in uids if uid not in name_of]
            if unknown:
                raise document.fault(keys, f"camera {unknown[0]} is not in the list of cameras", "export them together")
            packed = ranges[:, 0] | (ranges[:, 1] << np.uint64(32))
            first, count = packed & np.uint64((1 << 40) - 1), packed >> np.uint64(40)
            inside = len(cameras) == len(xy) and int((first + count).max(initial=0)) <= len(xy)
            if not inside or (len(cameras) and cameras.max() >= len(uids)):
                raise document.fault(keys, "matches beyond those that are there", "the project is incomplete")
            line = document.line(*keys)
            for k, (begin, n) in enumerate(zip(first.tolist(), count.tolist())):
                point = f"track {m}.{p}.{k}"
                rows += [
                    (name_of[uids[cameras[j]]], point, xy[j].tolist(), [np.nan] * 2, file, line)
                    for j in range(begin, begin + n)
                ]
    return rows


def _accessor(document: JsonText, keys: tuple[Key, ...], files: list[Path]) -> npt.NDArray[Any]:
    """The values (count, width) that an accessor leads to."""
    number = document.get(int, *keys)
    at: tuple[Key, ...] = ("accessors", number)
    component, width = document.get(int, *at, "componentType"), WIDTHS.get(document.get(str, *at, "type"), 0)
    if component not in COMPONENTS or not width:
        raise document.fault(at, "values of another type than tracks have", "export the tracks again")
    view: tuple[Key, ...] = ("bufferViews", document.get(int, *at, "bufferView"))
    buffer: tuple[Key, ...] = ("buffers", document.get(int, *view, "buffer"))
    uri = document.get(str, *buffer, "uri")
    path = document.path.parent / uri
    if not path.resolve().is_relative_to(document.path.parent.resolve()):
        raise document.fault(buffer, f"{uri!r} leads out of the folder of the tracks", "put the buffer beside them")
    data = read_bytes(path)
    if path not in files:
        files.append(path)
    dtype, count = np.dtype(COMPONENTS[component]), document.get(int, *at, "count")
    start = sum(document.get(int, *where, "byteOffset", default=0) for where in (view, at))
    stride = document.get(int, *view, "byteStride", default=width * dtype.itemsize)
    if start < 0 or count < 0 or (count and start + (count - 1) * stride + width * dtype.itemsize > len(data)):
        raise document.fault(at, f"{count} values reach beyond the end of {uri}", "the file is cut off: get it again")
    return np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize)).copy()
