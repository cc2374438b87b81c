"""Bundler's `bundle.out`, version 0.3, with its list of images if that lies beside it.

    # Bundle file v0.3
    images points
    images times    f k1 k2 / R (3 lines) / t        f = 0: the image is not oriented
    points times    X Y Z / R G B / m  m times (image feature x y)

P = R X + t, the camera looks along -z, y up; p' = f (1 + k1 |p|^2 + k2 |p|^4) p with p = -P / P_z; x, y are px from the
image centre, y up. Images are called by `list.txt` (or `*.list.txt`), else by their number.

Source: Snavely, Bundler v0.4 user's manual.
"""

from pathlib import Path

import numpy as np

from aatri.errors import InputError
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.poses import ground_from_image, is_rotation, position_of
from aatri.formats.nvm.sparse_model import SparseModel, parts_of_model
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, OF_MODELS, Format, Reading, begins
from aatri.formats.text.text_line import TextLine, word_lines
from aatri.ids import several
from aatri.progress import SILENT, Reporter

EXPORT = "the file is incomplete or no bundle file of version 0.3: export it again"


def read_bundler(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a bundle file."""
    lines = word_lines(path, reporter)
    if lines[0].words[0] != "#" or "v0.3" not in lines[0].words:
        raise lines[0].error("the first line is not `# Bundle file v0.3`", EXPORT)
    if len(lines) < 2 or len(lines[1].words) != 2:
        raise lines[-1].error("the numbers of images and points are not there", EXPORT)
    count, points = lines[1].count(0), lines[1].count(1)
    if len(lines) != 2 + 5 * count + 3 * points:
        what = f"{several(len(lines), 'line')}, where {several(count, 'image')} and {several(points, 'point')} need "
        what += str(2 + 5 * count + 3 * points)
        raise lines[1].error(what, EXPORT)
    names = _names(path, count, reporter)
    lenses, at, row_of = list[Lens](), list[int](), dict[int, int]()
    stated, translations = [], []
    for k in range(count):
        head, *rest = lines[2 + 5 * k : 7 + 5 * k]
        f, k1, k2 = head.of_width(3, "`f k1 k2`").numbers()
        R = np.array([line.of_width(3, "a row of R").numbers() for line in rest[:3]])
        t = rest[3].of_width(3, "t").numbers()
        if f == 0:
            continue
        if f < 0 or not is_rotation(R):
            raise head.error(f"image {names[k]}: focal length {f:g}, or R is no rotation", EXPORT)
        row_of[k] = len(lenses)
        lenses.append(
            Lens(names[k], "bundler", (2 * f, 2 * f), (f, f), parameters={"k1": k1, "k2": k2}, where=head.where)
        )
        stated.append(R)
        translations.append(t)
        at.append(head.line)
    xyz, marks, of_points, of_marks = [], [], [], []
    for k in range(points):
        place, _, seen = lines[2 + 5 * count + 3 * k : 5 + 5 * count + 3 * k]
        xyz.append(place.of_width(3, "X Y Z").numbers())
        of_points.append(place.line)
        if len(seen.words) != 1 + 4 * seen.count(0):
            raise seen.error(several(len(seen.words), "word"), "write `m` and m times `image feature x y`")
        for j in range(1, len(seen.words), 4):
            if (image := seen.count(j)) not in row_of:
                raise seen.error(f"image {image} is not there, or not oriented", EXPORT)
            marks.append((row_of[image], k, *seen.numbers(j + 2, j + 4)))
            of_marks.append(seen.line)
    if not lenses:
        raise InputError("no image is oriented", where=str(path), remedy="export a reconstruction")
    measured, R = np.array(marks).reshape(-1, 4), np.array(stated)
    centres = position_of(ground_from_image(R, "bundler"), np.array(translations), "bundler")
    model = SparseModel(
        lenses,
        R,
        centres,
        np.array(xyz).reshape(-1, 3),
        measured[:, 0].astype(np.int32),
        measured[:, 1].astype(np.int32),
        measured[:, 2:],
        (at, of_points, of_marks),
    )
    return parts_of_model("bundler", path, model, "up", reporter)


def _names(path: Path, count: int, reporter: Reporter) -> list[str]:
    """Names of the images: the first word of each line of the list beside the file, else their numbers."""
    lists = [p for p in (path.parent / "list.txt", path.with_suffix(".list.txt")) if p.is_file()]
    if not lists:
        return [str(k) for k in range(count)]
    lines = word_lines(lists[0], reporter)
    if len(lines) != count:
        where = f"{lists[0]}:{lines[-1].line}"
        raise InputError(
            f"{several(len(lines), 'image')}, but {path.name} has {count}", where=where, remedy="give the list of it"
        )
    first: dict[str, TextLine] = {}
    return [line.once(line.words[0], first, "image") for line in lines]


BUNDLER = Format(
    "bundler",
    "Bundler bundle.out",
    begins("# Bundle file v0.3"),
    "a line `# Bundle file v0.3`",
    carries=OF_MODELS,
    page="docs/formats.md#nvm-and-bundler",
    read=read_bundler,
    estimates_cameras=True,
)
