"""Inpho's project, `.prj`: cameras, orientations and image points.

    $BLOCK [value]            begins a block at the left margin, $END... ends it
      $KEY : value            inside of it; rows below belong to it, up to the next key

    $PHOTO      $PHOTO_NUM, $CAMERA_ID; $EXT_ORI: f X Y Z / three rows of a matrix; $PHOTO_POINTS: point x y ... mm
    $CAMERA, $CAMERA_DEFINITION     $ID, $FOCAL_LENGTH, $PRINCIPAL_POINT_PPA mm, in the active $CALIBRATION_SET

Image coordinates are mm from the principal point of the fiducials, x right, y up. Nothing published says which way the
matrices map; writers have ground to image, which is taken unless the lines of the flight show the other
(`conventions.poses`) or the user says it. What control points are (their codes), distortions and the fiducials
of film are published nowhere: they are told, not read.

Source: readers and writers of such files in public; no description of the format is.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from aatri.errors import InputError
from aatri.formats.conventions.poses import as_ground_from_image, is_rotation
from aatri.formats.limits import SAME_FOCAL_MM
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.text_line import TextLine, places, word_lines
from aatri.ids import clipped, several, shown
from aatri.progress import SILENT, Reporter

EXPORT = "export the project again"
UNITS = {"$LINEAR_UNITS_OF_OBJECT": "m", "$LINEAR_UNITS_OF_IMAGE": "mm"}


@dataclass
class Entry:
    """A key of a block: its line, whose words behind the colon are its value, and the rows below."""

    line: TextLine
    rows: list[TextLine] = field(default_factory=list)

    @property
    def words(self) -> list[str]:
        """The words behind the key."""
        return [word for word in self.line.words[1:] if word != ":"]


@dataclass
class Section:
    """A block: its first line and its keys in their order."""

    head: TextLine
    entries: list[Entry] = field(default_factory=list)

    def all(self, key: str) -> list[Entry]:
        """The entries of a key."""
        return [entry for entry in self.entries if entry.line.words[0] == key]

    def one(self, key: str) -> Entry:
        """The entry of a key that stands once."""
        entries = self.all(key)
        if len(entries) != 1:
            where = entries[1].line if entries else self.head
            raise where.error(f"{self.head.words[0]} has {len(entries)} lines {key}, not one", EXPORT)
        return entries[0]

    def name(self, key: str) -> str:
        """The value of a key as a name."""
        entry = self.one(key)
        if not entry.words:
            raise entry.line.error(f"{key} without a value", EXPORT)
        return " ".join(entry.words)


def read_inpho(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a project.

    Raises
    ------
    InputError
        If a block does not end or lacks what is read of it, an id stands twice, or units are others than m and mm.
    """
    sections = _sections(path, reporter)
    for section in sections:
        for key, unit in UNITS.items():
            for entry in section.all(key):
                if entry.words != [unit]:
                    what = f"{key[1:].lower().replace('_', ' ')}: {' '.join(entry.words)}"
                    raise entry.line.error(what, f"choose {unit} in the project, and export it again")
    cameras = [s for s in sections if s.head.words[0] in ("$CAMERA", "$CAMERA_DEFINITION")]
    photos = [s for s in sections if s.head.words[0] == "$PHOTO"]
    if not photos:
        raise InputError("no block $PHOTO", where=f"{path}:1", remedy=EXPORT)
    first: dict[str, TextLine] = {}
    of_camera = {(photo.name("$CAMERA_ID") if photo.one("$CAMERA_ID").words else "") for photo in photos}
    parts = BlockParts("inpho", [path], name=path.stem, frame=PLANE, notes=_not_read(sections))
    interior = {_camera_id(s, of_camera): _interior(s) for s in cameras}
    if len(interior) < len(cameras):
        twice = cameras[-1].head
        raise twice.error(f"two of the cameras {shown([*interior])} have one name", "give each an $ID of its own")
    if interior:
        parts.cameras = {
            "id": list(interior),
            "image_coordinates": "photo",
            "principal_distance_mm": [c for c, _ in interior.values()],
            "principal_point_mm": [point for _, point in interior.values()],
        }
    heads = [photo.one("$PHOTO_NUM").line for photo in photos]
    names = [heads[k].once(photo.name("$PHOTO_NUM"), first, "photo") for k, photo in enumerate(photos)]
    only = next(iter(interior)) if len(interior) == 1 else ""
    camera = [" ".join(photo.one("$CAMERA_ID").words) or only for photo in photos]
    at = places(heads, [path])
    parts.images = {"id": names, "camera": camera, **at}
    position, matrices = np.full((len(photos), 3), np.nan), np.full((len(photos), 3, 3), np.nan)
    for k, photo in enumerate(photos):
        c = interior[camera[k]][0] if camera[k] in interior else None
        for entry in photo.all("$EXT_ORI")[:1]:
            if entry.rows:
                position[k], matrices[k] = _orientation(entry, c)
    if np.isfinite(matrices).any():
        R, note = as_ground_from_image(matrices, position, reading.maps, f"{path}:1", "image_from_ground")
        parts.notes.append(note)
        parts.exterior = {"image": names, "position_m": position, "ground_from_image": R, **at}
    marks = [(name, row) for name, photo in zip(names, photos) for e in photo.all("$PHOTO_POINTS") for row in e.rows]
    if marks:
        rows = [row for _, row in marks]
        _check_one_layout(rows)
        parts.image_points = {
            "image": [name for name, _ in marks],
            "point": [row.words[0] for row in rows],
            "xy": [row.numbers(1, 3) for row in rows],
            **places(rows, [path]),
        }
    return parts


def _check_one_layout(rows: list[TextLine]) -> None:
    """Image points `id x y ... { }` of a project have one number of words: a blank within a number makes one more."""
    counts = [row.words.index("{") if "{" in row.words else len(row.words) for row in rows]
    usual = max(set(counts), key=counts.count)
    for row, count in zip(rows, counts):
        if count != usual:
            what = (
                f"{several(count, 'word')} before the braces, other image points have {usual}: a blank within a number?"
            )
            raise row.error(what, "write id x y and what follows as in the other lines")


def _sections(path: Path, reporter: Reporter) -> list[Section]:
    """The blocks of the file."""
    from aatri.formats.text.text_file import read_lines

    margin = {k for k, text in enumerate(read_lines(path, reporter), 1) if text.startswith("$")}
    sections, open_ = list[Section](), None
    for line in word_lines(path, reporter):
        key = line.words[0]
        if line.line in margin and key.startswith("$END"):
            if open_ is None:
                raise line.error(f"{key} without a block", EXPORT)
            open_ = None
        elif open_ is None:
            if line.line not in margin:
                raise line.error(f"{clipped(key)!r} where a block should begin", "blocks are `$NAME ... $END`")
            open_ = Section(line)
            sections.append(open_)
        elif line.line in margin:
            what = f"{key} begins before {open_.head.words[0]} of line {open_.head.line} has ended"
            raise line.error(what, EXPORT)
        elif key.startswith("$"):
            open_.entries.append(Entry(line))
        elif open_.entries:
            open_.entries[-1].rows.append(line)
    if open_ is not None:
        raise open_.head.error(f"{open_.head.words[0]} does not end", "the file is cut off: get it again")
    return sections


def _camera_id(section: Section, of_photos: set[str]) -> str:
    """$ID before the first calibration set, or $TYPE of old versions; without them the only one that photos name."""
    calibrations = [e.line.line for e in section.all("$CALIBRATION_SET")]
    own = [e for e in section.all("$ID") if not calibrations or e.line.line < calibrations[0]]
    stated = [" ".join(e.words) for e in (*own, *section.all("$TYPE")) if e.words]
    if own and stated:
        return stated[0]
    named = of_photos - {""}
    of_type = [name for name in stated if name in named]
    return of_type[0] if of_type else next(iter(named)) if len(named) == 1 else "camera"


def _interior(section: Section) -> tuple[float, list[float]]:
    """c and x0, y0 of the active calibration, mm."""
    sets = section.all("$CALIBRATION_SET")
    begin, end = section.head.line, float("inf")
    if len(sets) > 1:
        active = section.name("$ACTIVE_CALIBRATION")
        ids = [e for e in section.all("$ID") if e.line.line > sets[0].line.line and " ".join(e.words) == active]
        if len(ids) != 1:
            raise sets[0].line.error(f"calibration {active} is not among the {len(sets)}", EXPORT)
        begin = max(s.line.line for s in sets if s.line.line < ids[0].line.line)
        end = min((s.line.line for s in sets if s.line.line > begin), default=float("inf"))
    of_set = Section(section.head, [e for e in section.entries if begin < e.line.line < end])
    focal, point = of_set.one("$FOCAL_LENGTH"), of_set.one("$PRINCIPAL_POINT_PPA")
    (c,), xy = _numbers(focal, 1), _numbers(point, 2)
    if c <= 0:
        raise focal.line.error(f"focal length {c:g}", "it is positive, in mm")
    return c, xy


def _numbers(entry: Entry, count: int) -> list[float]:
    line = TextLine(entry.words, entry.line.path, entry.line.line)
    return line.of_width(count, f"{several(count, 'number')} of {entry.line.words[0]}").numbers()


def _orientation(entry: Entry, c: float | None) -> tuple[list[float], np.ndarray]:
    """Position and matrix as stated; the focal length beside them is that of the camera."""
    if len(entry.rows) < 4:
        raise entry.line.error(
            f"$EXT_ORI with {several(len(entry.rows), 'row')}", "write f X Y Z, and three rows of the matrix"
        )
    f, *position = entry.rows[0].of_width(4, "f X Y Z").numbers()
    if c is not None and abs(f - c) > SAME_FOCAL_MM:
        raise entry.rows[0].error(f"focal length {f:g}, that of the camera is {c:g}", "give one calibration")
    matrix = np.array([row.of_width(3, "a row of the matrix").numbers() for row in entry.rows[1:4]])
    if not is_rotation(matrix):
        raise entry.rows[1].error("this is no rotation matrix", EXPORT)
    return position, matrix


def _not_read(sections: Sequence[Section]) -> list[str]:
    """Blocks, and keys that would matter, that are not read."""
    blocks = {s.head.words[0] for s in sections} - {"$PROJECT", "$PHOTO", "$CAMERA", "$CAMERA_DEFINITION"}
    keys = {e.line.words[0] for s in sections for e in s.entries}
    unread = sorted(
        blocks | {key for key in keys if "DISTORTION" in key or key in ("$FIDUCIALS", "$COORDINATE_SYSTEM")}
    )
    return [f"not read: {shown(unread)}; give control, positions and calibration as lists beside it"] if unread else []


_BLOCK = re.compile(r"^\$(PROJECT\s+[0-9]|PHOTO\s*$|CAMERA(_DEFINITION)?\s*$)", re.MULTILINE)


def _recognised(view: FileView) -> str:
    seen = _BLOCK.search(view.head)
    return f"a block {seen.group().strip()}" if seen else ""


INPHO = Format(
    "inpho",
    "Inpho project (.prj)",
    _recognised,
    "blocks `$PROJECT`, `$CAMERA_DEFINITION`, `$PHOTO` ... `$END`",
    carries=("cameras", "image points", "start orientations"),
    page="docs/formats.md#inpho",
    read=read_inpho,
)
