"""The files of DBAT, the Damped Bundle Adjustment Toolbox: PhotoModeler's text export, and control point files.

The export (`*-pmexport.txt`) is whitespace-separated; blank lines separate its parts, photos are counted from 0:

    title
    tolerance  iterations  width height                      px
    nine default standard deviations                         not used
    c px py  format width height  K1 K2 K3 P1 P2             mm, the default camera
    their ten standard deviations                            not used
    per photo:  k path | k X Y Z kappa phi omega | their standard deviations | blank | k camera | its deviations
    control points   id X Y Z sX sY sZ                       the part may be empty
    object points    id X Y Z sX sY sZ                       control points again among them
    marks            k id x y sx sy                          px
    lines and pairs                                          not used

px, py are counted from the upper left corner of the format, y down. Angles are in degrees. A control file is
`id, name, X, Y, Z` with no standard deviation (fixed), one for all, or three; `#` begins a comment.

Source: the files of the DBAT data folder; Börlin & Grussenmeyer, Bundle adjustment with and without damping, 2013.

Decimal commas in lines whose cells are between commas: `1001, a, 10,5, 20, 30` reads as X 10, Y 5, Z 20, sigma 30.

Two cells of digits alone, side by side without a blank, may be one number. They are taken for two unless something
speaks against it: a blank after other commas between numbers of the line, more cells than most lines have, or that no
number of the file has a decimal point or an exponent.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

from aatri.errors import Faults, InputError, raise_all
from aatri.formats.limits import ROUNDING_MM
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import TextLine, blank_separated
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter


@dataclass(frozen=True)
class DefaultCamera:
    """The default camera: image size in px, c, px, py and format in mm, K1 K2 K3 P1 P2 in powers of mm."""

    size_px: tuple[float, float]
    c_mm: float
    principal_point_mm: tuple[float, float]
    format_mm: tuple[float, float]
    distortion: tuple[float, ...]


@dataclass(frozen=True)
class DbatPhoto:
    """A photo: name of its file, X Y Z in m, kappa phi omega in degrees, line of its orientation."""

    name: str
    position_m: tuple[float, ...]
    kappa_phi_omega_deg: tuple[float, ...]
    entry: TextLine


@dataclass(frozen=True)
class ObjectPoint:
    """Given coordinates of a point in m, its standard deviations, where it stands."""

    xyz_m: tuple[float, ...]
    sigma_m: tuple[float, ...]
    entry: TextLine


@dataclass(frozen=True)
class DbatMark:
    """A measured image point: row of the photo, id of the point, x y and their standard deviations in px."""

    photo: int
    point: str
    xy_px: tuple[float, ...]
    sigma_px: tuple[float, ...]
    entry: TextLine


@dataclass(frozen=True)
class Export:
    """What an export says. `control` is as PhotoModeler adjusted it, not as it was given."""

    title: str
    camera: DefaultCamera
    photos: list[DbatPhoto]
    control: dict[str, ObjectPoint]
    points: dict[str, ObjectPoint]
    marks: list[DbatMark]


def read_export(path: Path, reporter: Reporter = SILENT) -> Export:
    """Read PhotoModeler's text export.

    Raises
    ------
    InputError
        If the file is missing or a line is not of its form.
    """
    lines = [TextLine(blank_separated(text), path, k) for k, text in enumerate(read_lines(path, reporter), 1)]
    title = " ".join(lines[0].words)
    source = _Lines(lines, 1)
    size = source.next(4, "tolerance, iterations, image width and height").numbers()
    source.next(9, "default standard deviations")
    camera_line = source.next(10, "the default camera")
    camera = _camera(camera_line, size)
    source.next(10, "standard deviations of the camera")
    photos: list[DbatPhoto] = []
    while source.more():
        photos.append(_photo(source, len(photos), camera))
    if not photos:
        raise camera_line.error("no photo follows the cameras", "export the project with its photos")
    source.skip_blank()
    control = _points(source)
    source.skip_blank()
    points = _points(source)
    source.skip_blank()
    marks = _marks(source, len(photos))
    if not marks:
        raise InputError("no image point is marked", where=str(path), remedy="export the project with its marks")
    return Export(title, camera, photos, control, points, marks)


def read_control(path: Path, reporter: Reporter = SILENT) -> dict[str, ObjectPoint]:
    """Read a control point file; a point without standard deviations is fixed, its sigmas are 0.

    Raises
    ------
    InputError
        If the file is missing or a line is not of its form.
    """
    control, first, problems = dict[str, ObjectPoint](), dict[str, TextLine](), Faults()
    lines = [
        (k, text)
        for k, text in enumerate(read_lines(path, reporter), 1)
        if text.strip() and not text.lstrip().startswith("#")
    ]
    decimal = decimal_commas([text for _, text in lines])
    for (k, text), comma in zip(lines, decimal):
        entry = TextLine([cell.strip() for cell in text.split(",")], path, k)
        with problems.kept():
            if comma:
                what = f"{clipped(comma)!r} may be two numbers or one with a decimal comma"
                raise entry.error(what, "write a decimal point; a number without one as 10.0")
            point = _control_point(entry)
            control[entry.once(entry.words[0], first, "point")] = point
    raise_all(problems)
    if not control:
        raise InputError("no control point", where=str(path), remedy="write lines `id, name, X, Y, Z, sX, sY, sZ`")
    return control


@dataclass
class _Lines:
    """Lines being read, and the next one."""

    lines: list[TextLine]
    at: int

    def more(self) -> bool:
        """Whether the next line belongs to this part: it is there and not blank."""
        return self.at < len(self.lines) and bool(self.lines[self.at].words)

    def next(self, width: int, what: str) -> TextLine:
        """The next line, of at least one and (but for paths, width 0) exactly `width` words."""
        if self.at >= len(self.lines):
            raise self.lines[-1].error(f"the file ends where {what} should stand", "export the project again")
        entry = self.lines[self.at]
        self.at += 1
        return entry.of_width(width, what) if width else entry

    def skip_blank(self) -> None:
        """Pass the blank line between two parts."""
        if self.at < len(self.lines) and not self.lines[self.at].words:
            self.at += 1


def _camera(entry: TextLine, size: list[float]) -> DefaultCamera:
    value = entry.numbers()
    if not (value[0] > 0 and min(*value[3:5], *size[2:]) > 0):
        raise entry.error("principal distance, format and image size are not all positive", "mend the camera")
    return DefaultCamera((size[2], size[3]), value[0], (value[1], value[2]), (value[3], value[4]), tuple(value[5:]))


def _photo(source: _Lines, row: int, camera: DefaultCamera) -> DbatPhoto:
    """The six lines of a photo, the fourth of them blank."""
    head = source.next(0, "a photo")
    if len(head.words) < 2 or head.words[0] != str(row):
        raise head.error(f"{clipped(head.words[0])!r} where photo {row} should begin", "photos count from 0")
    name = PureWindowsPath(" ".join(head.words[1:])).name
    orientation = source.next(7, "photo X Y Z kappa phi omega")
    source.next(7, "their standard deviations")
    source.skip_blank()
    entry = source.next(11, "photo and its camera")
    source.next(11, "standard deviations of the camera")
    own = _camera(TextLine(entry.words[1:], entry.path, entry.line), [0.0, 0.0, *camera.size_px])
    pairs = zip(
        (own.c_mm, *own.principal_point_mm, *own.format_mm),
        (camera.c_mm, *camera.principal_point_mm, *camera.format_mm),
    )
    if any(abs(a - b) > ROUNDING_MM for a, b in pairs):
        raise entry.error(f"photo {name} has another camera than the default", "exports of one camera are read")
    value = orientation.numbers()
    return DbatPhoto(name, tuple(value[1:4]), tuple(value[4:]), orientation)


def _points(source: _Lines) -> dict[str, ObjectPoint]:
    points, first = dict[str, ObjectPoint](), dict[str, TextLine]()
    while source.more():
        entry = source.next(7, "id X Y Z sX sY sZ")
        point = ObjectPoint(tuple(entry.numbers(1, 4)), tuple(entry.numbers(4)), entry)
        points[entry.once(entry.words[0], first, "point")] = point
    return points


def _marks(source: _Lines, photos: int) -> list[DbatMark]:
    marks = []
    while source.more():
        entry = source.next(6, "photo id x y sx sy")
        photo, value = entry.count(0), entry.numbers(2)
        if photo >= photos:
            raise entry.error(f"photo {photo}, but the photos are 0 to {photos - 1}", "mend the number")
        if min(value[2:]) < 0 or min(value[2:]) == 0 < max(value[2:]):
            raise entry.error(
                f"standard deviations {value[2]:g}, {value[3]:g}", "they are positive, in pixels; or both 0: not given"
            )
        marks.append(DbatMark(photo, entry.words[1], tuple(value[:2]), tuple(value[2:]), entry))
    return marks


def _control_point(entry: TextLine) -> ObjectPoint:
    if len(entry.words) not in (5, 6, 8):
        raise entry.error(
            several(len(entry.words), "value"),
            "write `id, name, X, Y, Z`, and no, one or three standard deviations",
        )
    value = entry.numbers(2)
    sigma = {5: [0.0] * 3, 6: value[3:] * 3, 8: value[3:]}[len(entry.words)]
    if min(sigma) < 0:
        raise entry.error(f"a standard deviation of {min(sigma):g}", "it is 0 (fixed) or positive")
    return ObjectPoint(tuple(value[:3]), tuple(sigma), entry)


_PAIR = re.compile(r"(?<![0-9.])[+-]?[0-9]+,[0-9]+(?![0-9.])")
WITHOUT_SIGMA = 5
"""Cells of a line `id, name, X, Y, Z`: more are standard deviations, or parts of numbers."""


def decimal_commas(lines: Sequence[str]) -> list[str]:
    """For each line the first pair of cells that may be a number with a decimal comma; empty where there is none."""
    numbers = [line.split(",", 2)[2] if line.count(",") > 1 else "" for line in lines]
    cells = [line.count(",") + 1 for line in lines]
    usual = Counter(cells).most_common(1)[0][0] if cells else 0
    with_points = any(sign in text for text in numbers for sign in ".eE")
    commas = []
    for text, count in zip(numbers, cells):
        pair = _PAIR.search(text) if count > WITHOUT_SIGMA else None
        uneven = re.search(r",\s", text) is not None
        suspect = pair is not None and (uneven or count > usual or not with_points)
        commas.append(pair.group() if pair and suspect else "")
    return commas
