"""What DJI's drones write into the XMP packet of a photograph, or beside it: position, its accuracy, the gimbal.

    GpsLatitude GpsLongitude      degrees, WGS 84 (`GpsLongtitude` in older files)
    AbsoluteAltitude              m, ellipsoidal with RTK; otherwise barometric, no better than a start value
    RtkStdLat RtkStdLon RtkStdHgt m; RtkFlag 50 with a fixed solution
    GimbalYawDegree GimbalPitchDegree GimbalRollDegree

Positions with RTK standard deviations are observed, all others are start values, and so are attitudes. The gimbal turns
from north, east, down by yaw, pitch, roll about z, y, x; the camera looks along its x axis, so that pitch -90 looks
straight down:

    R = T Rz(yaw) Ry(pitch) Rx(roll) M,   M = columns (0 1 0), (0 0 -1), (-1 0 0): right, up and back of the camera,
                                          T from north, east, down to east, north, up

No pixel is decoded: the packet is looked for in the first bytes of the file.

Source: DJI, manuals of Zenmuse P1 and Mavic 3M; Adobe, XMP specification part 3 (ISO 16684-1).
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from aatri.arrays import Float
from aatri.codes import APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.names import without_extension
from aatri.formats.navigation.mrk import FIXED
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.text_file import missing
from aatri.formats.text.xml_tree import XmlElement, decoded_xml, read_xml
from aatri.frames.conversion import WGS84
from aatri.geometry.rotations import ENU_FROM_NED, rotation_from_angles
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter
from aatri.regular_file import open_regular

PHOTOGRAPHS = (".jpg", ".jpeg", ".xmp", ".tif", ".tiff", ".dng")
"""Endings of files that have a packet; it is looked for by its content."""
BODY_FROM_CAMERA = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""M: the camera (x right, y up, z back) in the gimbal (x forward, y right, z down)."""

HEAD_BYTES = 1 << 20
"""The packet lies among the first segments of a file."""
BEGIN, END = b"<x:xmpmeta", b"</x:xmpmeta>"
SPACE = "drone-dji:"


def read_xmp(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a photograph, a sidecar file, or those of a folder.

    Raises
    ------
    InputError
        If a packet is broken or lacks the position, or there is none at all.
    """
    if not path.exists():
        raise missing(path)
    listed = sorted(p for p in path.iterdir() if p.suffix.lower() in PHOTOGRAPHS) if path.is_dir() else [path]
    packets = [(p, packet) for p in listed if (packet := drone_packet(p)) is not None]
    if not packets:
        what = f"no XMP packet of a drone in {'any of its files' if path.is_dir() else 'it'}"
        raise InputError(what, where=str(path), remedy="give the photographs as the drone wrote them")
    files = [p for p, _ in packets]
    stated = [_with_position(packet) for _, packet in packets]
    names = _names(files)
    sigma = np.array([[t.get(f"RtkStd{axis}", np.nan) for axis in ("Lon", "Lat", "Hgt")] for t in stated])
    flags = np.array([t.get("RtkFlag", np.nan) for t in stated])
    sigma[(sigma == 0).all(axis=1) & (flags == 0)] = np.nan  # no solution: nothing is known
    if (bad := np.flatnonzero((sigma <= 0).any(axis=1))).size:
        what = f"RTK standard deviations {sigma[bad[0]].tolist()}"
        raise packets[int(bad[0])][1].error(what, "they are positive, in m: without a solution they are not there")
    observed = np.isfinite(sigma).all(axis=1)
    place = np.array([[t["GpsLongitude"], t["GpsLatitude"], t["AbsoluteAltitude"]] for t in stated])
    angles = np.radians([[t.get(f"Gimbal{axis}Degree", np.nan) for axis in ("Roll", "Pitch", "Yaw")] for t in stated])
    parts = BlockParts("dji_xmp", files, name=path.stem, frame=WGS84)
    at = {
        "file": list(range(len(files))),
        "line": [packet.line if p.suffix.lower() == ".xmp" else -1 for p, packet in packets],
    }
    parts.images = {"id": names, **at}
    parts.exterior = {
        "image": names,
        "position_m": place,
        "sigma_m": np.where(observed[:, None], sigma, np.nan),
        "position_use": np.where(observed, OBSERVED_VALUE, APPROXIMATE_VALUE),
        "ground_from_image": of_gimbal(angles),
        **at,
    }
    parts.notes = _notes(names, [t.get("RtkFlag") for t in stated], observed.tolist())
    if len(packets) < len(listed):
        parts.notes.append(
            f"{several(len(listed) - len(packets), 'file', 'has', 'have')} no packet of a drone: "
            f"{shown([p.name for p in listed if p not in files])}"
        )
    reporter.log(f"{path}: {several(len(packets), 'packet')}")
    return parts


def of_gimbal(angles_rad: Float) -> Float:
    """Rotations (n, 3, 3) to east, north and up by roll, pitch and yaw (n, 3) of the gimbal."""
    return np.asarray(ENU_FROM_NED @ rotation_from_angles(angles_rad, "roll-pitch-heading") @ BODY_FROM_CAMERA)


def _notes(names: Sequence[str], flags: Sequence[float | None], observed: Sequence[bool]) -> list[str]:
    notes = []
    if plain := [name for name, is_observed in zip(names, observed) if not is_observed]:
        notes.append(
            f"start values, with barometric heights: {several(len(plain), 'position')} without RTK: {shown(plain)}"
        )
    loose = [
        n for n, flag, is_observed in zip(names, flags, observed) if is_observed and flag is not None and flag < FIXED
    ]
    if loose:
        notes.append(f"{several(len(loose), 'exposure')} without a fixed solution: {shown(loose)}")
    return notes


def drone_packet(path: Path) -> XmlElement | None:
    """The packet of a file with anything of DJI in it, its lines counted in the file; None if it has none."""
    try:
        with open_regular(path) as file:
            data = file.read(HEAD_BYTES)
    except OSError as error:
        if not path.exists():
            raise missing(path) from error
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), remedy="check the file") from error
    begin = data.find(BEGIN)
    if begin < 0 or (path.suffix.lower() != ".xmp" and SPACE.encode() not in data):
        return None
    end = data.find(END, begin)
    inner = data[begin : end + len(END)] if end >= 0 else data[begin:]
    before = b"\n" * data.count(b"\n", 0, begin) if path.suffix.lower() == ".xmp" else b""
    text = decoded_xml(before + inner, path)
    return read_xml(path, ("xmpmeta",), "an XMP packet", text)


def _with_position(packet: XmlElement) -> dict[str, float]:
    """Numbers of a packet that must have a position."""
    numbers = drone_numbers(packet)
    absent = [key for key in ("GpsLatitude", "GpsLongitude", "AbsoluteAltitude") if key not in numbers]
    if absent:
        raise packet.error(
            f"the packet has no {', '.join(absent)} of DJI", "give the photographs as the drone wrote them"
        )
    return numbers


def drone_numbers(packet: XmlElement) -> dict[str, float]:
    """Numbers of DJI by their keys, written as attributes or as elements."""
    numbers: dict[str, float] = {}
    for description in packet.within("Description"):
        for key, text in description.attributes.items():
            if key.startswith(SPACE):
                _put(numbers, description, key.removeprefix(SPACE), text)
        for child in description.children:
            _put(numbers, child, child.tag, child.text)
    return numbers


def _put(numbers: dict[str, float], element: XmlElement, key: str, text: str) -> None:
    key = {"GpsLongtitude": "GpsLongitude"}.get(key, key)
    if key.startswith(("Gps", "AbsoluteAlt", "RtkStd", "RtkFlag", "Gimbal")) and not key.endswith(
        ("Status", "Reverse")
    ):
        if key in numbers:
            raise element.error(f"{key} twice", "remove one")
        numbers[key] = element.parsed(text.strip(), key)


def _names(files: Sequence[Path]) -> list[str]:
    """Images are called as their file, those of sidecar files without the ending .xmp."""
    names = [p.name.removesuffix(".xmp").removesuffix(".XMP") for p in files]
    stems: dict[str, Path] = {}
    for name, path in zip(names, files):
        before = stems.setdefault(without_extension(name), path)
        if before != path:
            what = f"the image {without_extension(name)} has a packet in {before.name} too"
            raise InputError(what, where=str(path), remedy="keep one of them")
    return names


SOME = 5
"""So many photographs of a folder are looked at."""


def _xmp(view: FileView) -> str:
    if not view.is_folder:
        is_one = view.path.suffix.lower() in PHOTOGRAPHS and "drone-dji:" in view.head and "<x:xmpmeta" in view.head
        return "an XMP packet with drone-dji" if is_one else ""
    names = [name for name in view.names if name.lower().endswith(PHOTOGRAPHS)][:SOME]
    return next((f"{name}, {seen}" for name in names if (seen := _xmp(view.of(name)))), "")


def files_with(endings: tuple[str, ...], view: FileView) -> list[Path]:
    """The files of a folder that have one of some endings; a file itself."""
    names = [name for name in view.names if name.lower().endswith(endings)]
    return [view.path / name for name in names] if view.is_folder else [view.path]


XMP = Format(
    "dji_xmp",
    "DJI photographs (XMP)",
    _xmp,
    "photographs or .xmp files with a packet `x:xmpmeta` of `drone-dji`",
    carries=("positions", "start orientations", "standard deviations", "frame"),
    page="docs/formats.md#dji-xmp",
    read=read_xmp,
    files_of=partial(files_with, PHOTOGRAPHS),
)
