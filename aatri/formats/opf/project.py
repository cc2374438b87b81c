"""The items of an OPF project: a JSON document each, found by the format that `project.opf` says it is of.

Items and formats that are not known are named, not read. A URI leads to a file in the folder of the project or below.

    canonical = swap(scale base) + shift

The processing system is the canonical one; `swap` exchanges x and y where the base has north first. So canonical less
shift is east, north, up of the base, in metres if its scale is 1.

Source: the specification, github.com/Pix4D/opf-spec, versions 1.x.

Tracks of an OPF calibration: a glTF document whose primitives have the extension OPF_mesh_primitive_matches.

    pointIndexRanges   per point two uint32 = 40 bits offset, 24 bits count, little-endian
    cameraIds          per match the row of its camera in cameraUids
    pixelCoordinates   per match column and row, px from the upper left corner

Accessors lead through buffer views to binary files beside the document. What is not told has no standard deviation.

Source: the specification, github.com/Pix4D/opf-spec; Khronos Group, glTF 2.0 specification, section 3.6.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.parts.block_parts import PLANE
from aatri.formats.text.json_text import JsonText, Key
from aatri.formats.text.text_file import read_bytes
from aatri.frames.conversion import Frame
from aatri.ids import clipped, shown

PROJECT = "application/opf-project+json"
SPECIFICATION = "a project by the OPF specification 1.x"
READ = (
    "camera-list",
    "input-cameras",
    "projected-input-cameras",
    "input-control-points",
    "projected-control-points",
    "calibrated-cameras",
    "scene-reference-frame",
    "sparse",
)
"""Resources that are read, by their format."""

EXTENSION = "OPF_mesh_primitive_matches"
COMPONENTS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class SceneFrame(NamedTuple):
    """The frame of the block, and what is subtracted from processing coordinates, m."""

    frame: Frame
    shift_m: Float


class OpfProject:
    """The documents of a project, by what they hold."""

    def __init__(self, path: Path) -> None:
        self.path = _project_file(path)
        self.document = JsonText(self.path, SPECIFICATION)
        _check_format(self.document, PROJECT)
        self.name = self.document.get(str, "name")
        self.files = [self.path]
        self.resources: dict[str, Path] = {}
        others = set[str]()
        for i, item in enumerate(self.document.get(list, "items")):
            kind = self.document.get(str, "items", i, "type")
            for j, _ in enumerate(self.document.get(list, "items", i, "resources")):
                keys: tuple[Key, ...] = ("items", i, "resources", j)
                name = _resource(kind, self.document.get(str, *keys, "format"))
                if name in READ:
                    if name in self.resources:
                        what = f"a second resource {name}"
                        raise self.document.fault(keys, what, "a project of one calibration is wanted")
                    self.resources[name] = self._file(keys)
                elif not name.startswith(("buffer", "point_cloud")):
                    others.add(name if kind in item["type"] and name else kind)
        self.notes = [f"not read: {shown(sorted(others))}"] if others else []

    def open(self, name: str) -> JsonText | None:
        """The document of a resource; None if the project has none."""
        if name not in self.resources:
            return None
        document = JsonText(self.resources[name], SPECIFICATION)
        _check_format(document, f"application/opf-{name}+json")
        self.files.append(document.path)
        return document

    def _file(self, keys: tuple[Key, ...]) -> Path:
        """Where a URI leads."""
        uri = self.document.get(str, *keys, "uri")
        parts, folder = urlsplit(uri), self.path.parent.resolve()
        target = (folder / unquote(parts.path)).resolve()
        if parts.scheme or parts.netloc or not target.is_relative_to(folder):
            what = f"{clipped(uri)!r} leads out of the folder of the project"
            raise self.document.fault(keys, what, "put the file beside project.opf, and name it relative to that")
        if not target.is_file():
            remedy = "the project is not whole: copy this file too, or take its resource out"
            raise self.document.fault(keys, f"{clipped(uri)!r} does not exist", remedy)
        return self.path.parent / unquote(parts.path)

    def scene(self) -> SceneFrame | None:
        """The frame of processing coordinates, and their shift; None where the project does not say it."""
        document = self.open("scene-reference-frame")
        if document is None:
            return None
        keys = ("base_to_canonical",)
        scale = document.numbers(*keys, "scale", count=3)
        if scale != [1.0, 1.0, 1.0]:
            what = f"the scale from the base to the canonical system is {scale}"
            raise document.fault(keys, what, "a base that counts in metres is wanted")
        shift = np.array(document.numbers(*keys, "shift", count=3))
        frame, undulation_m = frame_of(document, ("crs",))
        if frame.geographic or "x" in frame.axes:
            raise document.fault(keys, "the base is no map", "choose a projected system for the project")
        return SceneFrame(replace(frame, axes=("east", "north", "up")), shift - [0.0, 0.0, undulation_m])


def frame_of(document: JsonText, keys: tuple[Key, ...]) -> tuple[Frame, float]:
    """The frame that a `crs` names, its axes in the order of its coordinates, and what heights are raised by, m."""
    from aatri.frames.crs_text import crs_from

    text = document.get(str, *keys, "definition")
    undulation_m = document.get(float, *keys, "geoid_height", default=0.0)
    try:
        system = crs_from(text)
    except Exception as error:  # of pyproj
        what = f"the system {clipped(text, 60)!r} is not understood: {clipped(str(error), 100)}"
        raise document.fault(keys, what, "write EPSG:n, EPSG:n+m, or WKT 2") from error
    if system.is_engineering:
        return PLANE, undulation_m
    flat = system.sub_crs_list[0] if system.is_compound else system
    crs = flat.to_wkt() if undulation_m else text  # a height above a stated geoid becomes ellipsoidal
    if system.is_geocentric:
        return Frame("opf", ("x", "y", "z"), crs), 0.0
    names = ("latitude", "longitude") if system.is_geographic else ("north", "east")
    plan = names if flat.axis_info[0].direction == "north" else names[::-1]
    return Frame("opf", (*plan, "height" if system.is_geographic else "up"), crs), undulation_m


def _resource(item: str, format: str) -> str:
    """What a resource holds: the words of its format, `sparse` for the tracks of a calibration."""
    if format == "model/gltf+json":
        return "sparse" if item == "calibration" else item
    return "buffer" if "buffer" in format else format.removeprefix("application/opf-").removesuffix("+json")


def _check_format(document: JsonText, expected: str) -> None:
    stated, version = document.get(str, "format"), document.get(str, "version")
    if stated != expected:
        raise document.fault(
            ("format",), f"the format is {clipped(stated)!r}, not {expected!r}", f"give {SPECIFICATION}"
        )
    if version.partition(".")[0] != "1":
        raise document.fault(("version",), f"version {clipped(version)!r}", "versions 1.x are read")


def _project_file(path: Path) -> Path:
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.opf"))
    if len(files) != 1:
        what = f"{len(files)} files *.opf" if files else "no file project.opf"
        raise InputError(what, where=str(path), remedy="name the file of the project")
    return files[0]


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
