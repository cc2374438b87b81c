"""Reading of WuCAPS files, the Chinese block adjustment system: camera, image coordinates, ground points, roles.

Whitespace-separated text, GBK or ASCII, `-99` ends a list. Names of the files in any case and with any extension:

- PRECAI camera: `cameras fiducials`; c x0 y0; distortion (zeros); per fiducial: number x y; lengths in mm
- PREPHI image coordinates: `strip count scale 0` opens a strip, `photo 0` a photo (negative: the last of the strip),
  `point x y` in mm; the photo scale number stands times 10
- PRECKI ground points: id, X north, Y east, H in m
- PRECPI roles: `full plan height`, the numbers of full, plan-only and height-only control points; their ids; ids that
  follow are check points

Image coordinates have their origin at the fiducial centre, x0 y0 are not subtracted. Ground coordinates are turned
into east, north, up. Ground points without a role keep their coordinates. Two strips of the same number are two
strips; strips are then named by their order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from aatri.artifacts.block import (
    CHECK,
    CONTROL,
    NO_ROLE,
    Block,
    CameraParameters,
    Cameras,
    DistortionTable,
    Exterior,
    FiducialPoints,
    Fiducials,
    Files,
    Frames,
    Geodetic,
    GeodeticCovariances,
    GroundPoints,
    ImagePoints,
    Images,
    Points,
    Rejects,
    RelativeControl,
    RelativeControlMembers,
    Strips,
)
from aatri.errors import AatriError, Errors, InputError, raise_all
from aatri.formats.block_images import image_point_order
from aatri.formats.block_source import texts
from aatri.formats.csv_table import number_of
from aatri.formats.screening import screen_block
from aatri.formats.text_file import missing, read_lines
from aatri.ids import canonical, did_you_mean, is_valid, printable, rows_of
from aatri.progress import SILENT, Reporter

NAMES = ("PRECAI", "PREPHI", "PRECKI", "PRECPI")
CAMERA = "PRECAI"
END = "-99"
T = TypeVar("T")


@dataclass(frozen=True)
class Record:
    """The words of a line, and where it stands."""

    words: list[str]
    path: Path
    line: int

    def error(self, what: str, remedy: str = "") -> InputError:
        """An error at this line."""
        return InputError(what, where=f"{self.path}:{self.line}", remedy=remedy)

    def number(self, k: int) -> float:
        """The word as a number."""
        try:
            return number_of(self.words[k])
        except ValueError as error:
            raise self.error(f"{printable(self.words[k])!r}: {error}", "write it like -1234.5") from error

    def count(self, k: int) -> int:
        """The word as a whole number, not negative."""
        if not (self.words[k].isascii() and self.words[k].isdigit() and len(self.words[k]) < 9):
            raise self.error(f"{printable(self.words[k])!r} is no count", "write a whole number")
        return int(self.words[k])


@dataclass(frozen=True)
class _Camera:
    interior: tuple[float, float, float]
    fiducials: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class _Photo:
    id: str
    strip: int
    sequence: int
    record: Record


@dataclass(frozen=True)
class _Measured:
    photo: str
    point: str
    xy: tuple[float, float]
    record: Record


def read_wucaps(folder: Path, *, image_sigma_mm: float = 0.010, control_sigma_m: float | None = None,
                reporter: Reporter = SILENT) -> Block:  # fmt: skip
    """Read a folder of WuCAPS files.

    Parameters
    ----------
    folder : Path
    image_sigma_mm : float, mm
        Standard deviation of image coordinates; the files have none.
    control_sigma_m : float, m, optional
        Standard deviation of control and check points; None: exact.
    reporter : Reporter

    Raises
    ------
    InputError
        If a file is missing or a line is not of its form.
    """
    if not folder.is_dir():
        raise missing(folder)
    paths = [_find(folder, name) for name in NAMES]
    records = [_records(path, reporter) for path in paths]
    problems: list[AatriError] = []
    camera = _collected(lambda: _camera(records[0], paths[0]), problems)
    measured = _collected(lambda: _image_coordinates(records[1]), problems)
    ground = _collected(lambda: _ground(records[2], paths[2]), problems)
    raise_all(problems)
    assert camera is not None
    assert measured is not None
    assert ground is not None
    roles = _roles(records[3], paths[3], ground)
    block = _block(folder, paths, camera, measured, ground, roles, image_sigma_mm, control_sigma_m or 0.0)
    return screen_block(block, reporter)


def _collected(read: Callable[[], T], problems: list[AatriError]) -> T | None:
    """What is read; None if it has faults, which are kept."""
    try:
        return read()
    except Errors as several:
        problems.extend(several.errors)
    except InputError as error:
        problems.append(error)
    return None


def _find(folder: Path, name: str) -> Path:
    """The file of this name, whatever its case and extension."""
    found = sorted(p for p in folder.iterdir() if p.is_file() and p.stem.upper() == name)
    if not found:
        raise missing(folder / f"{name}.DAT")
    if len(found) > 1:
        names = " and ".join(p.name for p in found)
        raise InputError(f"two files {name}: {names}", where=str(folder), remedy="remove one")
    return found[0]


def _records(path: Path, reporter: Reporter) -> list[Record]:
    lines = read_lines(path, reporter)
    records = [Record(words, path, k) for k, text in enumerate(lines, 1) if (words := text.replace("\x1a", "").split())]
    if not records:
        raise InputError("the file has no rows", where=str(path), remedy="put the data in")
    return records


def _camera(records: list[Record], path: Path) -> _Camera:
    """PRECAI."""
    head = _of_width(records, 0, 2, path, "numbers of cameras and fiducials")
    if head.count(0) != 1:
        raise head.error(f"{head.words[0]} cameras", "blocks of one camera are read; write others as block folder")
    interior = _of_width(records, 1, 3, path, "c x0 y0")
    values = interior.number(0), interior.number(1), interior.number(2)
    if values[0] <= 0:
        raise interior.error(f"principal distance {values[0]:g}", "it is in mm and positive")
    lens = _of_width(records, 2, 3, path, "distortion")
    if any(lens.number(k) != 0 for k in range(3)):
        raise lens.error("distortion parameters, whose meaning is not known", "convert to a block folder")
    fiducials: dict[str, tuple[float, float]] = {}
    for k in range(3, len(records)):
        if _ends(records[k]):
            break
        row = _of_width(records, k, 3, path, "fiducial x y")
        if row.words[0] in fiducials:
            raise row.error(f"fiducial {row.words[0]} twice", "remove one")
        fiducials[_id(row, 0)] = row.number(1), row.number(2)
    if len(fiducials) != head.count(1):
        raise head.error(f"{head.words[1]} fiducials announced, {len(fiducials)} found", "mend the number or the list")
    return _Camera(values, fiducials)


def _image_coordinates(records: list[Record]) -> tuple[list[str], list[_Photo], list[_Measured]]:
    """PREPHI: names of the strips, photos in order, measurements."""
    numbers: list[str] = []
    photos: dict[str, _Photo] = {}
    measured: list[_Measured] = []
    problems: list[AatriError] = []
    photo, last = "", True
    for record in records:
        try:
            if photo and len(record.words) == 3:
                if _ends(record):
                    photo = ""
                else:
                    measured.append(_Measured(photo, _id(record, 0), (record.number(1), record.number(2)), record))
            elif photo:
                raise record.error(f"{len(record.words)} words in photo {photo}", "each line is `point x y`; -99 ends")
            elif len(record.words) == 4:
                if not last:
                    raise record.error(
                        "a new strip, but the last one has no last photo", "make its last number negative"
                    )
                numbers.append(_id(record, 0))
                last = False
            elif len(record.words) == 2 and numbers and not _ends(record):
                photo, last = record.words[0].removeprefix("-"), record.words[0].startswith("-")
                _add_photo(photos, photo, len(numbers) - 1, record)
            elif not _ends(record):
                raise record.error(f"{len(record.words)} words, but a strip or photo should begin here",
                                   "a strip is `strip count scale 0`, a photo `photo 0`")  # fmt: skip
        except InputError as error:
            problems.append(error)
    if photo:
        problems.append(records[-1].error(f"the file ends within photo {photo}", "end it with -99 0 0"))
    raise_all(problems)
    names = numbers if len(set(numbers)) == len(numbers) else [str(k + 1) for k in range(len(numbers))]
    return names, list(photos.values()), measured


def _add_photo(photos: dict[str, _Photo], name: str, strip: int, record: Record) -> None:
    if not is_valid(name):
        raise record.error(f"{printable(name)!r} is no photo number")
    if name in photos:
        earlier = photos[name].record.line
        raise record.error(f"photo {name} twice, first in line {earlier}", "give each photo its own number")
    photos[name] = _Photo(name, strip, len(photos) + 1, record)


def _ground(records: list[Record], path: Path) -> dict[str, tuple[list[float], Record]]:
    """PRECKI: east, north, up by id."""
    ground: dict[str, tuple[list[float], Record]] = {}
    problems: list[AatriError] = []
    for k, record in enumerate(records):
        if _ends(record):
            break
        try:
            row = _of_width(records, k, 4, path, "id X Y H")
            name = _id(row, 0)
            if name in ground:
                raise row.error(f"point {printable(name)} twice, first in line {ground[name][1].line}", "remove one")
            ground[name] = [row.number(2), row.number(1), row.number(3)], record
        except InputError as error:
            problems.append(error)
    raise_all(problems)
    return ground


def _roles(records: list[Record], path: Path, ground: dict[str, tuple[list[float], Record]]) -> dict[str, list[int]]:
    """PRECPI: role of east, north, up by id."""
    head = _of_width(records, 0, 3, path, "numbers of full, plan-only and height-only control points")
    full, plan, height = (head.count(k) for k in range(3))
    named = [record for record in records[1:] if not _ends(record)]
    if len(named) < full + plan + height:
        raise head.error(
            f"{full + plan + height} control points announced, {len(named)} ids follow", "mend the numbers"
        )
    roles: dict[str, list[int]] = {}
    problems: list[AatriError] = []
    for k, record in enumerate(named):
        name = record.words[0]
        if name not in ground:
            what = f"point {printable(name)!r} is not in the ground point file{did_you_mean(name, ground)}"
            problems.append(record.error(what, "add it to PRECKI, or mend the id"))
        elif name in roles:
            problems.append(record.error(f"point {printable(name)} has two roles", "a point is control or check"))
        elif k < full:
            roles[name] = [CONTROL] * 3
        elif k < full + plan:
            roles[name] = [CONTROL, CONTROL, NO_ROLE]
        elif k < full + plan + height:
            roles[name] = [NO_ROLE, NO_ROLE, CONTROL]
        else:
            roles[name] = [CHECK] * 3
    raise_all(problems)
    return roles


def _of_width(records: list[Record], k: int, width: int, path: Path, what: str) -> Record:
    if k >= len(records):
        raise InputError(f"ends before the line of {what}", where=str(path), remedy="complete the file")
    if len(records[k].words) != width:
        raise records[k].error(f"{len(records[k].words)} words where {what} should stand", f"write {width} of them")
    return records[k]


def _ends(record: Record) -> bool:
    return record.words[0] in (END, "-99.0")


def _id(record: Record, k: int) -> str:
    if not is_valid(record.words[k]):
        raise record.error(f"{printable(record.words[k])!r} is no id")
    return record.words[k]


def _block(folder: Path, paths: list[Path], camera: _Camera, measured: tuple[list[str], list[_Photo], list[_Measured]],
           ground: dict[str, tuple[list[float], Record]], roles: dict[str, list[int]], image_sigma_mm: float,
           control_sigma_m: float) -> Block:  # fmt: skip
    """All tables in canonical order."""
    strip_names, photos, rows = measured
    photos = sorted(photos, key=lambda p: p.id.encode())
    strips = canonical(strip_names)
    image_ids = [p.id for p in photos]
    point_ids = canonical([*(m.point for m in rows), *ground])
    return Block(
        name=folder.resolve().name,
        rotation="phi-omega-kappa",
        earth_curvature="correct",
        terrain_height_m=np.nan,
        files=Files(path=texts(map(str, paths))),
        frames=Frames(id=texts(["map"]), axes=texts(["north,east,up"]), crs=texts(["local"]), vertical=texts([""])),
        cameras=_camera_table(camera),
        camera_parameters=CameraParameters.empty(),
        distortion_table=DistortionTable.empty(),
        fiducials=_fiducial_table(camera),
        strips=Strips(id=texts(strips)),
        images=_image_table(photos, rows_of([strip_names[p.strip] for p in photos], strips)),
        fiducial_points=FiducialPoints.empty(),
        points=Points(id=texts(point_ids)),
        image_points=_image_point_table(rows, image_ids, point_ids, image_sigma_mm),
        ground_points=_ground_table(ground, roles, point_ids, control_sigma_m),
        exterior=Exterior.empty(),
        geodetic=Geodetic.empty(),
        geodetic_covariances=GeodeticCovariances.empty(),
        relative_control=RelativeControl.empty(),
        relative_control_members=RelativeControlMembers.empty(),
        rejects=Rejects.empty(),
    )


def _camera_table(camera: _Camera) -> Cameras:
    c, x0, y0 = camera.interior
    unknown = np.full((1, 2), np.nan)
    return Cameras(
        id=texts([CAMERA]), kind=texts(["film"]), image_coordinates=texts(["photo"]), pixel_size_mm=unknown,
        pixel_origin=texts([""]), pixel_y=texts([""]), format=unknown, principal_distance_mm=np.array([c]),
        principal_point_mm=np.array([[x0, y0]]), symmetry_point_mm=np.zeros((1, 2)), distortion=texts(["none"]),
        lever_arm_m=np.zeros((1, 3)), boresight_rad=np.zeros((1, 3)),
    )  # fmt: skip


def _fiducial_table(camera: _Camera) -> Fiducials:
    marks = canonical(camera.fiducials)
    return Fiducials(camera=np.zeros(len(marks), np.int32), id=texts(marks),
                     xy_mm=np.array([camera.fiducials[m] for m in marks]).reshape(-1, 2))  # fmt: skip


def _image_table(photos: list[_Photo], strip: np.ndarray[tuple[int], np.dtype[np.int32]]) -> Images:
    n = len(photos)
    blank = texts([""] * n)
    return Images(
        id=texts(p.id for p in photos), camera=np.zeros(n, np.int32), strip=strip,
        sequence=np.array([p.sequence for p in photos], float), time_s=np.full(n, np.nan), flight=blank,
        session=blank, rig=blank, member=blank, active=np.ones(n, bool),
        file=np.full(n, NAMES.index("PREPHI"), np.int32),
        line=np.array([p.record.line for p in photos], np.int32),
    )  # fmt: skip


def _image_point_table(
    rows: list[_Measured], image_ids: list[str], point_ids: list[str], sigma_mm: float
) -> ImagePoints:
    n = len(rows)
    table = ImagePoints(
        image=rows_of([m.photo for m in rows], image_ids), point=rows_of([m.point for m in rows], point_ids),
        xy=np.array([m.xy for m in rows], float).reshape(n, 2), sigma_mm=np.full((n, 2), sigma_mm),
        group=texts([""] * n), active=np.ones(n, bool), row_time_s=np.full(n, np.nan),
        file=np.full(n, NAMES.index("PREPHI"), np.int32), line=np.array([m.record.line for m in rows], np.int32),
    )  # fmt: skip
    return table.take(image_point_order(table))


def _ground_table(ground: dict[str, tuple[list[float], Record]], roles: dict[str, list[int]], point_ids: list[str],
                  sigma_m: float) -> GroundPoints:  # fmt: skip
    names = canonical(ground)
    n = len(names)
    return GroundPoints(
        point=rows_of(names, point_ids), xyz_m=np.array([ground[p][0] for p in names]).reshape(n, 3),
        covariance_m2=np.tile(np.eye(3) * (sigma_m * sigma_m), (n, 1, 1)),
        role=np.array([roles.get(p, [NO_ROLE] * 3) for p in names], np.int32).reshape(n, 3),
        datum=np.zeros(n, bool), file=np.full(n, NAMES.index("PRECKI"), np.int32),
        line=np.array([ground[p][1].line for p in names], np.int32),
    )  # fmt: skip
