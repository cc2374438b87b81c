"""Reading of model coordinates, as a plotter or a textbook gives them: points of stereo models, without images.

    model point X Y Z [sigma]             a point of a model, in axes and a unit of the model's own, Z upwards
    model point X Y Z [sigma] centre      a perspective centre of it

Words between blanks or commas, lines that begin with # are left out, so is a first line of names. Models have any
place, direction and scale. Points with the same name in several models are the same point; control and check points
are those of pair files (`ground_lines`).
"""

from pathlib import Path

from aatri.artifacts.block import Block
from aatri.artifacts.builder import block_of
from aatri.errors import InputError
from aatri.formats.pairs.reader import ground_lines, ground_of, rows_of_list
from aatri.formats.text.text_line import TextLine
from aatri.ids import several
from aatri.progress import SILENT, Reporter

FORM = "model point X Y Z [sigma] [centre]"
CENTRE = "centre"


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
