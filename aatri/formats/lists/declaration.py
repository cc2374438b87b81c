"""What lists are recognised by, and what they carry: any list with a header, and those of IGN and Applanix."""

import re
from functools import partial

from aatri.formats.lists.list_form import MOST_BEFORE, proposed
from aatri.formats.lists.list_reader import read_list
from aatri.formats.lists.list_writer import write_lists
from aatri.formats.parts.format import FileView, Format

PAGE = "docs/formats.md#lists"
APPLANIX_UNITS = re.compile(r"^\s*\(position in .*orientation in", re.IGNORECASE | re.MULTILINE)


def _list(view: FileView) -> str:
    form = proposed(view.lines) if not view.is_folder and view.lines else None
    return f"a header: {' '.join(form.columns.words)}" if form else ""


def _ign(view: FileView) -> str:
    """Its header is the first line, or comes after comments or up to five lines of a heading."""
    words = [line.lstrip("# ").split()[:7] for line in view.lines[:MOST_BEFORE]]
    comments = sum(line.startswith("#") for line in view.lines[:MOST_BEFORE])
    is_one = ["NOM", "X", "Y", "Z", "O", "P", "K"] in words[: comments + 6]
    return "a header NOM X Y Z O P K" if is_one else ""


def _applanix(view: FileView) -> bool:
    return bool(APPLANIX_UNITS.search(view.head))


TABLE = Format(
    "table", "list with columns", _list, "a header with the columns of a list: image X Y Z omega phi kappa ...",
    carries=("positions", "attitudes", "start orientations", "control", "check points", "image points", "times",
             "standard deviations"),
    page=PAGE, read=read_list, write=write_lists,
    other_names=("opk", "list"),
    written=("start orientations", "control", "check points", "image points", "standard deviations"),
)  # fmt: skip
IGN_OPK = Format(
    "ign_opk",
    "IGN orientations (.OPK)",
    _ign,
    "a header NOM X Y Z O P K CAMERA",
    carries=("start orientations", "positions", "attitudes"),
    page=PAGE,
    read=partial(read_list, preset="ign"),
)
APPLANIX = Format(
    "applanix",
    "Applanix EO text",
    _applanix,
    "a line `(position in Meters, orientation in Degrees ...)`",
    carries=("positions", "attitudes", "times"),
    page=PAGE,
    read=partial(read_list, observed=True),
)
