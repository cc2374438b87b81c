"""Reading of pair files: the interior elements of the camera and the point pairs of one model, as students write them.

    c [x0 y0]                 principal distance and principal point, mm
    point x1 y1 x2 y2         photo coordinates of a point in the left and the right photo

One file a model, words between blanks or commas; lines that begin with # are left out, `-99` or `end` ends a list. A
folder holds the models of a strip in the order of their names. `319-320.dat` is of the photos 319 and 320; other names
are numbered, the right photo of a file being the left one of the next. A point of two files has one measurement in the
photo they share, or two where each model was measured by itself: both count, if they agree within their standard
deviations (screening).

Ground points: `point X Y Z` (east, north, up, m), one file of control and one of check points.

Source: lecture notes A113, A309.

Reading of model coordinates, as a plotter or a textbook gives them: points of stereo models, without images.

    model point X Y Z [sigma]             a point of a model, in axes and a unit of the model's own, Z upwards
    model point X Y Z [sigma] centre      a perspective centre of it

Words between blanks or commas, lines that begin with # are left out, so is a first line of names. Models have any
place, direction and scale. Points with the same name in several models are the same point; control and check points
are those of pair files (`ground_lines`).
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, Block
from aatri.artifacts.builder import block_of
from aatri.errors import InputError
from aatri.formats.text.text_file import missing, read_lines
from aatri.formats.text.text_line import TextLine, blank_separated, word_lines
from aatri.ids import clipped, is_valid, several
from aatri.progress import SILENT, Reporter

STRIP, CAMERA = "1", "camera"
END = ("-99", "-99.0", "end")
"""First words of a line that ends a list."""

WORDS = {"blanks": ",", "remark": "#"}
Place = tuple[float, float]
Measured = tuple[Place, TextLine]

FORM = "model point X Y Z [sigma] [centre]"
CENTRE = "centre"


def read_pairs(
    folder: Path,
    *,
    unit_um: float,
    image_sigma_um: float,
    control: Path | None = None,
    check: Path | None = None,
    control_sigma_m: float = 0.0,
    reporter: Reporter = SILENT,
) -> Block:
    """Read a folder of pair files.

    Parameters
    ----------
    folder : Path
        Of files *.dat.
    unit_um : float, um
        Unit of the photo coordinates; interior elements are in mm.
    image_sigma_um : float, um
    control, check : Path, optional
    control_sigma_m : float, m
        Of control and check points; 0: exact.

    Raises
    ------
    InputError
        If a file is missing or a line is not of its form, or files of one strip contradict each other.
    """
    if not folder.is_dir():
        raise missing(folder)
    models = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".dat")
    if not models:
        raise InputError("no pair files", where=str(folder), remedy="their names end with .dat")
    paths = [*models, *(p for p in (control, check) if p is not None)]
    interior: list[float] = []
    order: list[str] = []
    measured: dict[tuple[str, str], list[Measured]] = {}
    for number, path in enumerate(models):
        rows = rows_of_list(path, reporter)
        photos = _photos(path, number)
        interior = _interior(rows[0], interior)
        order += [photo for photo in photos if photo not in order]
        for row in rows[1:]:
            _add(row, photos, unit_um * 1e-3, measured)
    surveyed = ground_lines(control, check, reporter)
    c, x0, y0 = interior
    every = [(name, one) for name, rows in measured.items() for one in rows]
    return block_of(
        name=folder.resolve().name,
        rotation="phi-omega-kappa",
        files=paths,
        cameras={
            "id": CAMERA,
            "kind": "film",
            "image_coordinates": "photo",
            "principal_distance_mm": c,
            "principal_point_mm": [x0, y0],
        },
        images={
            "id": order,
            "camera": CAMERA,
            "strip": STRIP,
            "sequence": np.arange(1.0, len(order) + 1),
            "line": 1,
        },
        image_points={
            "image": [photo for (photo, _), _ in every],
            "point": [point for (_, point), _ in every],
            "xy": [place for _, (place, _) in every],
            "sigma_mm": image_sigma_um * 1e-3,
            "at": [entry for _, (_, entry) in every],
        },
        ground_points=ground_of(surveyed, control_sigma_m),
    )


def rows_of_list(path: Path, reporter: Reporter = SILENT) -> list[TextLine]:
    """The lines of a file before its end mark, where it has one; an error if rows follow that."""
    rows = word_lines(path, reporter, **WORDS)
    for row, comma in zip(rows, _decimal_commas(path, rows)):
        if comma:
            what = f"{clipped(comma)!r} between blanks may be two numbers or one with a decimal comma"
            raise row.error(what, "write a decimal point; a blank after a comma that parts numbers")
    end = next((k for k, row in enumerate(rows) if row.words[0].lower() in END), len(rows))
    after = [row for row in rows[end:] if row.words[0].lower() not in END]
    if after:
        raise after[0].error(f"rows after the end mark of line {rows[end].line}", "remove the mark, or the rows")
    if not end:
        raise InputError("no rows before the end mark", where=str(path), remedy="put the data in")
    return rows[:end]


def _decimal_commas(path: Path, rows: list[TextLine]) -> list[str]:
    """For each row the first word `1,2`, where blanks part other words of the row."""
    texts = read_lines(path)
    words = [blank_separated(texts[row.line - 1]) for row in rows]
    return [next((word for word in line if len(line) > 1 and _TWO.fullmatch(word)), "") for line in words]


_TWO = re.compile(r"[+-]?[0-9]+,[0-9]+")


def _photos(path: Path, number: int) -> tuple[str, str]:
    """Names of the left and right photo."""
    left, dash, right = path.stem.partition("-")
    if dash and is_valid(left) and is_valid(right) and left != right:
        return left, right
    return str(number + 1), str(number + 2)


def _interior(row: TextLine, before: list[float]) -> list[float]:
    """Principal distance, x0, y0, the same in all files."""
    if len(row.words) not in (1, 3):
        raise row.error(
            f"{several(len(row.words), 'word')} where the interior elements should be", "write `c` or `c x0 y0`, in mm"
        )
    values = row.numbers()
    values += [0.0] * (3 - len(values))
    if values[0] <= 0:
        raise row.error(f"principal distance {values[0]:g}", "it is in mm and positive")
    if before and before != values:
        raise row.error(f"interior elements {values}, the files before have {before}", "one camera took a strip")
    return values


def _add(
    row: TextLine, photos: tuple[str, str], unit_mm: float, measured: dict[tuple[str, str], list[Measured]]
) -> None:
    """A point pair."""
    point = row.of_width(5, "point x1 y1 x2 y2").words[0]
    places = [(row.number(k) * unit_mm, row.number(k + 1) * unit_mm) for k in (1, 3)]
    for photo, place in zip(photos, places):
        before = measured.setdefault((photo, point), [])
        for _, entry in before:
            if entry.path == row.path:
                raise row.error(f"point {point} twice, first in line {entry.line}", "remove one")
        # written down again it is the same measurement; read anew it is another one
        if all(max(abs(a - b) for a, b in zip(place, other)) > 1e-9 for other, _ in before):
            before.append((place, row))


def ground_lines(control: Path | None, check: Path | None, reporter: Reporter) -> list[tuple[TextLine, int]]:
    """The lines of the files of control and check points, with their role."""
    surveyed = [(path, role) for path, role in ((control, CONTROL), (check, CHECK)) if path is not None]
    return [(row, role) for path, role in surveyed for row in rows_of_list(path, reporter)]


def ground_of(lines: list[tuple[TextLine, int]], sigma_m: float, axes: str = "east,north,up") -> dict[str, Any]:
    """Columns of ground points from lines `point X Y Z`, m, in these axes; `-` stands for what is not known."""
    first: dict[str, TextLine] = {}
    order = [0, 1, 2] if axes.startswith("east") else [1, 0, 2]
    xyz = np.array([_coordinates(entry.of_width(4, "point X Y Z")) for entry, _ in lines]).reshape(-1, 3)[:, order]
    return {
        "point": [entry.once(entry.words[0], first, "point") for entry, _ in lines],
        "xyz_m": xyz,
        "sigma_m": sigma_m,
        "role": np.where(np.isfinite(xyz), np.array([role for _, role in lines])[:, None], NO_ROLE),
        "at": [entry for entry, _ in lines],
    }


def _coordinates(entry: TextLine) -> list[float]:
    """X, Y, Z of a line, NaN where a dash stands for a coordinate."""
    xyz = [np.nan if word == "-" else entry.number(k) for k, word in enumerate(entry.words) if k]
    if np.isnan(xyz[0]) != np.isnan(xyz[1]) or np.isnan(xyz).all():
        raise entry.error("a point known in neither plan nor height", "give X and Y, or Z, or all three")
    return xyz


def read_models(
    path: Path,
    *,
    sigma: float,
    centre_sigma: float | None = None,
    axes: str = "east,north,up",
    control: Path | None = None,
    check: Path | None = None,
    control_sigma_m: float = 0.0,
    reporter: Reporter = SILENT,
) -> Block:
    """Read a file of model coordinates.

    Parameters
    ----------
    sigma, centre_sigma : float, unit of the models
        Of a coordinate where its line states none, and of perspective centres; None: the same.
    axes : str
        Of control and check points: `east,north,up` or `north,east,up`.
    control, check : Path, optional
        Lines `point X Y Z`, m.
    control_sigma_m : float, m
        0: exact.

    Raises
    ------
    InputError
        If a file is missing, a line is not of its form, or a model gives a point twice.
    """
    rows = rows_of_list(path, reporter)
    if rows[0].words[:2] == ["model", "point"]:
        rows = rows[1:]
    if not rows:
        raise InputError("no model coordinates", where=str(path), remedy=f"write lines `{FORM}`")
    first: dict[str, TextLine] = {}
    centre = [row.words[-1] == CENTRE for row in rows]
    for row, is_centre in zip(rows, centre):
        if len(row.words) - is_centre not in (5, 6):
            raise row.error(
                f"{several(len(row.words), 'word')} where `{FORM}` should stand", "write them, parted by blanks"
            )
        row.once(f"{row.words[1]} of model {row.words[0]}", first, "point")
    sigmas = [
        row.number(5) if len(row.words) - is_centre == 6 else (centre_sigma or sigma) if is_centre else sigma
        for row, is_centre in zip(rows, centre)
    ]
    for row, value in zip(rows, sigmas):
        if not value > 0:
            raise row.error(f"standard deviation {value:g}", "it is in the unit of the model and above 0")
    surveyed = ground_lines(control, check, reporter)
    return block_of(
        name=path.stem,
        files=[path, *(p for p in (control, check) if p is not None)],
        model_coordinates={
            "model": [row.words[0] for row in rows],
            "point": [row.words[1] for row in rows],
            "xyz": [row.numbers(2, 5) for row in rows],
            "sigma": sigmas,
            "centre": centre,
            "at": rows,
        },
        ground_points=ground_of(surveyed, control_sigma_m, axes),
    )
