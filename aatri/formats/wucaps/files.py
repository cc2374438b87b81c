"""The files of WuCAPS, the Chinese block adjustment system: camera, image coordinates, ground points, roles.

Whitespace-separated text, GBK or ASCII, `-99` ends a list. Names of the files in any case and with any extension:

- PRECAI camera: `cameras fiducials`; c x0 y0; distortion (zeros); per fiducial: number x y; lengths in mm
- PREPHI image coordinates: `strip count scale 0` opens a strip, `photo 0` a photo (negative: the last of the strip),
  `point x y` in mm; the photo scale number stands times 10
- PRECKI ground points: id, X north, Y east, H in m
- PRECPI roles: `full plan height`, the numbers of full, plan-only and height-only control points; their ids; ids that
  follow are check points
- PRENPI, if there is one: non-photogrammetric observations, see `observations`
"""

from dataclasses import dataclass
from pathlib import Path

from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.text.text_file import missing
from aatri.formats.text.text_line import TextLine, word_lines
from aatri.formats.wucaps.observations import NAME as OBSERVATIONS
from aatri.formats.wucaps.observations import Columns, ends, observations
from aatri.ids import clipped, did_you_mean, several
from aatri.progress import SILENT, Reporter

NAMES = ("PRECAI", "PREPHI", "PRECKI", "PRECPI")


@dataclass(frozen=True)
class Camera:
    """Principal distance, x0, y0, and fiducials by number, mm."""

    interior: tuple[float, float, float]
    fiducials: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class WucapsPhoto:
    """A photo, the row of its strip and its place in the file."""

    id: str
    strip: int
    sequence: int
    entry: TextLine


@dataclass(frozen=True)
class StatedStrip:
    """What the first line of a strip says: its number of photos, and the photo scale number times 10; 0: nothing."""

    photos: int
    scale_times_10: float
    entry: TextLine


@dataclass(frozen=True)
class MeasuredPoint:
    """A measured image point, mm."""

    photo: str
    point: str
    xy: tuple[float, float]
    entry: TextLine


@dataclass(frozen=True)
class GroundPoint:
    """A ground point: east, north, up, m."""

    xyz_m: tuple[float, float, float]
    entry: TextLine


@dataclass(frozen=True)
class WucapsFiles:
    """What the files say. Roles are per east, north, up; `paths` are in the order of `NAMES`, then PRENPI if any."""

    paths: list[Path]
    camera: Camera
    strips: list[str]
    photos: list[WucapsPhoto]
    measured: list[MeasuredPoint]
    stated: list[StatedStrip]
    ground: dict[str, GroundPoint]
    roles: dict[str, list[int]]
    exterior: Columns
    geodetic: Columns


def read_files(folder: Path, reporter: Reporter = SILENT) -> WucapsFiles:
    """Read and check the four files of a folder.

    Raises
    ------
    InputError
        If a file is missing or a line is not of its form.
    """
    if not folder.is_dir():
        raise missing(folder)
    paths = [_find(folder, name) for name in NAMES]
    entries = [word_lines(path, reporter, blanks="\x1a") for path in paths]
    problems = Faults()
    observed: tuple[Columns, Columns] = {}, {}
    with problems.kept():
        camera = _camera(entries[0], paths[0])
    with problems.kept():
        images = _image_coordinates(entries[1])
    with problems.kept():
        ground = _ground(entries[2])
        roles = _roles(entries[3], paths[3], ground)
    if any(p.is_file() and p.stem.upper() == OBSERVATIONS for p in folder.iterdir()):
        paths.append(_find(folder, OBSERVATIONS))
        with problems.kept():
            observed = observations(word_lines(paths[-1], reporter, blanks="\x1a"))
    raise_all(problems)
    return WucapsFiles(paths, camera, *images, ground, roles, *observed)


def _find(folder: Path, name: str) -> Path:
    """The file of this name, whatever its case and extension."""
    files = sorted(p for p in folder.iterdir() if p.is_file() and p.stem.upper() == name)
    if not files:
        raise missing(folder / f"{name}.DAT")
    if len(files) > 1:
        names = " and ".join(p.name for p in files)
        raise InputError(f"two files {name}: {names}", where=str(folder), remedy="remove one")
    return files[0]


def _camera(entries: list[TextLine], path: Path) -> Camera:
    """PRECAI."""
    head = _of_width(entries, 0, 2, path, "numbers of cameras and fiducials")
    if head.count(0) != 1:
        raise head.error(f"{head.words[0]} cameras", "blocks of one camera are read; write others as block folder")
    interior = _of_width(entries, 1, 3, path, "c x0 y0")
    c, x0, y0 = interior.numbers()
    if c <= 0:
        raise interior.error(f"principal distance {c:g}", "it is in mm and positive")
    lens = _of_width(entries, 2, 3, path, "distortion")
    if any(lens.numbers()):
        raise lens.error("distortion parameters, whose meaning is not known", "convert to a block folder")
    fiducials, first = dict[str, tuple[float, float]](), dict[str, TextLine]()
    for k in range(3, len(entries)):
        if ends(entries[k]):
            break
        row = entries[k].of_width(3, "fiducial x y")
        fiducials[row.once(row.words[0], first, "fiducial")] = row.number(1), row.number(2)
    if len(fiducials) != head.count(1):
        raise head.error(
            f"{several(head.count(1), 'fiducial')} announced, {len(fiducials)} found", "mend the number or the list"
        )
    return Camera((c, x0, y0), fiducials)


def _image_coordinates(
    entries: list[TextLine],
) -> tuple[list[str], list[WucapsPhoto], list[MeasuredPoint], list[StatedStrip]]:
    """PREPHI: names of the strips, photos in order, measurements."""
    numbers: list[str] = []
    stated: list[StatedStrip] = []
    photos, first = list[WucapsPhoto](), dict[str, TextLine]()
    measured: list[MeasuredPoint] = []
    problems, photo, last = Faults(), "", True
    for entry in entries:
        with problems.kept():
            if photo and ends(entry) and len(entry.words) < 4:
                photo = ""
            elif photo and len(entry.words) == 3:
                measured.append(MeasuredPoint(photo, entry.words[0], (entry.number(1), entry.number(2)), entry))
            elif photo:
                raise entry.error(
                    f"{several(len(entry.words), 'word')} in photo {photo}", "each line is `point x y`; -99 ends"
                )
            elif len(entry.words) == 4:
                if not last:
                    raise entry.error(
                        "a new strip, but the last one has no last photo", "make its last number negative"
                    )
                numbers.append(entry.words[0])
                stated.append(StatedStrip(entry.count(1), entry.number(2), entry))
                last = False
            elif len(entry.words) == 2 and numbers and not ends(entry):
                photo, last = entry.words[0].removeprefix("-"), entry.words[0].startswith("-")
                entry.once(photo, first, "photo", "give each photo its own number")
                photos.append(WucapsPhoto(photo, len(numbers) - 1, len(photos) + 1, entry))
            elif not ends(entry):
                raise entry.error(
                    f"{several(len(entry.words), 'word')}, but a strip or photo should begin here",
                    "a strip is `strip count scale 0`, a photo `photo 0`",
                )
    if photo:
        problems.append(entries[-1].error(f"the file ends within photo {photo}", "end it with -99 0 0"))
    raise_all(problems)
    names = numbers if len(set(numbers)) == len(numbers) else [str(k + 1) for k in range(len(numbers))]
    return names, photos, measured, stated


def _ground(entries: list[TextLine]) -> dict[str, GroundPoint]:
    """PRECKI: east, north, up by id."""
    ground, first, problems = dict[str, GroundPoint](), dict[str, TextLine](), Faults()
    for entry in entries:
        if ends(entry):
            break
        with problems.kept():
            north, east, up = entry.of_width(4, "id X Y H").numbers(1)
            ground[entry.once(entry.words[0], first, "point")] = GroundPoint((east, north, up), entry)
    raise_all(problems)
    return ground


def _roles(entries: list[TextLine], path: Path, ground: dict[str, GroundPoint]) -> dict[str, list[int]]:
    """PRECPI: role of east, north, up by id."""
    head = _of_width(entries, 0, 3, path, "numbers of full, plan-only and height-only control points")
    full, plan, height = (head.count(k) for k in range(3))
    named = [entry for entry in entries[1:] if not ends(entry)]
    if len(named) < full + plan + height:
        raise head.error(
            f"{several(full + plan + height, 'control point')} announced, {several(len(named), 'id')} follow",
            "mend the numbers",
        )
    roles, problems = dict[str, list[int]](), Faults()
    for k, entry in enumerate(named):
        name = entry.words[0]
        if len(entry.words) > 1:
            problems.append(
                entry.error(f"{several(len(entry.words), 'word')} where an id should stand", "write one id a line")
            )
        elif name not in ground:
            what = f"point {clipped(name)!r} is not in the ground point file{did_you_mean(name, ground)}"
            problems.append(entry.error(what, "add it to PRECKI, or mend the id"))
        elif name in roles:
            problems.append(entry.error(f"point {clipped(name)} has two roles", "a point is control or check"))
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


def _of_width(entries: list[TextLine], k: int, width: int, path: Path, what: str) -> TextLine:
    if k >= len(entries):
        raise InputError(f"ends before the line of {what}", where=str(path), remedy="complete the file")
    return entries[k].of_width(width, what)
