"""The items of an OPF project: a JSON document each, found by the format that `project.opf` says it is of.

Items and formats that are not known are named, not read. A URI leads to a file in the folder of the project or below.

    canonical = swap(scale base) + shift

The processing system is the canonical one; `swap` exchanges x and y where the base has north first. So canonical less
shift is east, north, up of the base, in metres if its scale is 1.

Source: the specification, github.com/Pix4D/opf-spec, versions 1.x.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.parts.block_parts import PLANE
from aatri.formats.text.json_text import JsonText, Key
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
