"""Formats that have a variant of the role `block` of their own: how they are recognised, and read beside others."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np

from aatri.artifacts.block import Block
from aatri.codes import CONTROL
from aatri.formats.bal.problem import read_bal, write_bal_problem
from aatri.formats.colmap.reader import read_colmap
from aatri.formats.colmap.writer import write_colmap_model
from aatri.formats.dbat.files import read_control
from aatri.formats.dbat.reader import read_dbat
from aatri.formats.gama.reader import read_gama
from aatri.formats.pairs.reader import read_pairs
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import OF_MODELS, Content, FileView, Format, Reading, Writing, all_files
from aatri.formats.parts.of_block import parts_of
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.tables.reader import read_block
from aatri.formats.tables.settings.reading import read_settings
from aatri.formats.tables.writer import write_block
from aatri.formats.text.number_text import is_number
from aatri.formats.text.text_line import places
from aatri.formats.wucaps.reader import read_wucaps
from aatri.formats.wucaps.writer import write_oriented
from aatri.frames.axes import columns_in_order
from aatri.progress import Reporter

_NUMBER = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"
_BAL_HEAD = re.compile(r"\s*[0-9]+\s+[0-9]+\s+[0-9]+\s*$")
_BAL_ROW = re.compile(rf"\s*[0-9]+\s+[0-9]+\s+{_NUMBER}\s+{_NUMBER}\s*$")
_PAIR_HEAD = re.compile(rf"\s*{_NUMBER}(?:[\s,]+{_NUMBER}[\s,]+{_NUMBER})?\s*$")
_PAIR_ROW = re.compile(rf"\s*\S+(?:[\s,]+{_NUMBER}){{4}}\s*$")
_WUCAPS = ("PRECAI", "PREPHI", "PRECKI", "PRECPI")
OF_FLIGHTS: tuple[Content, ...] = (
    "cameras",
    "image points",
    "control",
    "check points",
    "strips",
    "film",
    "positions",
    "attitudes",
    "geodetic observations",
)
_COLMAP = ("cameras", "images", "points3D")


def _reads(name: str, read_block: Callable[..., Block]) -> Callable[[Path, Reading, Reporter], BlockParts]:
    """A reader of a Block as a reader of parts."""
    return lambda path, _, reporter: parts_of(read_block(path, reporter=reporter), name)


def _read_tables(path: Path, _: Reading, reporter: Reporter) -> BlockParts:
    """A block folder; the standard deviations of its block.yaml are those of control and positions beside it, too.

    They stand there in the order of the axes of its first frame, which the tables have.
    """
    parts = parts_of(read_block(path, reporter=reporter), "tables")
    settings, _document = read_settings(path / "block.yaml")
    stated = {"control_sigma": settings.sigma.control, "position_sigma": settings.sigma.position}
    unit_m = settings.units.sigma_ground_m
    order = columns_in_order(next(iter(settings.frames.values())).axes)
    sigma_m = {k: tuple((unit_m * np.broadcast_to(v, 3)[order]).tolist()) for k, v in stated.items() if v is not None}
    return replace(parts, not_stated=sigma_m)


def _write_tables(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    write_block(oriented.block, folder)


def _tables(view: FileView) -> str:
    text = view.of("block.yaml").head if "block.yaml" in view.names else ""
    return "block.yaml with aatri_block" if re.search(r"^aatri_block\s*:", text, re.M) else ""


def _colmap(view: FileView) -> str:
    for ending in (".txt", ".bin"):
        if view.is_folder and all(f"{name}{ending}" in view.names for name in _COLMAP):
            return f"cameras{ending}, images{ending}, points3D{ending}"
    return ""


def _wucaps(view: FileView) -> str:
    names = {name.upper().partition(".")[0] for name in view.names}
    return ", ".join(_WUCAPS) if view.is_folder and names.issuperset(_WUCAPS) else ""


def _gama(view: FileView) -> str:
    return "<gama-local>" if re.search(r"<gama-local[\s>]", view.head) else ""


def _dbat(view: FileView) -> str:
    rows = [line.split() for line in view.lines[1:5]]
    is_head = [len(row) for row in rows] == [4, 9, 10, 10] and all(is_number(word) for row in rows for word in row)
    return "the head of a PhotoModeler export" if is_head else ""


def _dbat_control(view: FileView) -> str:
    rows = [line.split(",") for line in view.lines if not line.lstrip().startswith("#")]
    alike = all(
        len(row) in (5, 6, 8) and row[0].strip().isdigit() and all(re.fullmatch(_NUMBER, c.strip()) for c in row[2:])
        for row in rows
    )
    named = any(re.search("[A-Za-z]", row[1]) for row in rows) if alike else False
    return "rows `number, name, X, Y, Z` and standard deviations" if named and not view.is_folder else ""


def _read_dbat(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    """An export with the control that is named beside it; without, nothing says yet which points are determined."""
    control = reading.control
    parts = parts_of(read_dbat(path, control, set_aside=control is None, reporter=reporter), "dbat")
    return parts if control is None else replace(parts, frame=PLANE)


def _read_dbat_control(path: Path, _: Reading, reporter: Reporter) -> BlockParts:
    points = read_control(path, reporter)
    ground = {
        "point": list(points),
        "xyz_m": [p.xyz_m for p in points.values()],
        "sigma_m": [p.sigma_m for p in points.values()],
        "role": CONTROL,
        **places([p.entry for p in points.values()], [path]),
    }
    return BlockParts("dbat_control", [path], name=path.stem, frame=PLANE, ground_points=ground)


def _bal(view: FileView) -> str:
    lines = view.lines
    is_problem = len(lines) > 3 and _BAL_HEAD.match(lines[0]) and all(map(_BAL_ROW.match, lines[1:4]))
    return "numbers of cameras, points and observations, then observations" if is_problem else ""


def _pairs(view: FileView) -> str:
    names = [name for name in view.names if name.lower().endswith(".dat")]
    if not view.is_folder or not names:
        return ""
    for name in names:
        lines = [line for line in view.of(name).lines if not line.lstrip().startswith("#")]
        if len(lines) < 2 or not _PAIR_HEAD.match(lines[0]) or not all(map(_PAIR_ROW.match, lines[1:4])):
            return ""
    return f"{len(names)} files *.dat of point pairs"


def _format(
    name: str,
    title: str,
    recognise: Callable[[FileView], str],
    looked_for: str,
    read_block: Callable[..., Block],
    **more: Any,
) -> Format:
    read = _reads(name, read_block)
    return Format(name, title, recognise, looked_for, stage=f"block/{name}", read=read, **more)


TABLES = Format(
    "tables", "block folder of aatri", _tables, "a folder with block.yaml", read=_read_tables, stage="block/tables",
    carries=("cameras", "distortion", "image points", "control", "check points", "start values of points", "positions",
             "attitudes", "start orientations", "strips", "times", "frame", "standard deviations", "covariances",
             "rigs", "film", "geodetic observations"),
    page="docs/formats.md#the-block-folder", files_of=all_files, write=_write_tables, written=get_args(Content),
)  # fmt: skip
WUCAPS = _format(
    "wucaps",
    "WuCAPS",
    _wucaps,
    "a folder with PRECAI, PREPHI, PRECKI, PRECPI",
    read_wucaps,
    carries=OF_FLIGHTS,
    page="docs/formats.md#wucaps-files",
    files_of=all_files,
    write=write_oriented,
    written=OF_FLIGHTS,  # what of these PRENPI does not hold, write_oriented tells
)
DBAT = Format(
    "dbat", "PhotoModeler export, with DBAT control", _dbat, "a text export of PhotoModeler", read=_read_dbat,
    stage="block/dbat", beside=(("dbat_control", "control"),),
    carries=("cameras", "distortion", "image points", "control", "start values of points", "start orientations",
             "standard deviations"),
    page="docs/formats.md#dbat-photomodeler-exports",
)  # fmt: skip
DBAT_CONTROL = Format(
    "dbat_control",
    "DBAT control points",
    _dbat_control,
    "rows `number, name, X, Y, Z` and no, one or three standard deviations, commas between",
    read=_read_dbat_control,
    carries=("control", "standard deviations"),
    page="docs/formats.md#dbat-photomodeler-exports",
)
BAL = _format(
    "bal",
    "Bundle Adjustment in the Large",
    _bal,
    "three numbers, then rows `camera point x y`",
    read_bal,
    carries=OF_MODELS,
    page="docs/formats.md#bundle-adjustment-in-the-large",
    write=write_bal_problem,
    written=OF_MODELS,
)
COLMAP = _format(
    "colmap",
    "COLMAP sparse model",
    _colmap,
    "a folder with cameras, images, points3D (.txt or .bin)",
    read_colmap,
    carries=OF_MODELS,
    page="docs/formats.md#colmap-models",
    files_of=all_files,
    write=write_colmap_model,
    written=OF_MODELS,
    estimates_cameras=True,
)
PAIRS = _format(
    "pairs",
    "pair files of models",
    _pairs,
    "a folder of files *.dat: principal distance, then `point x1 y1 x2 y2`",
    partial(read_pairs, unit_um=1000.0, image_sigma_um=10.0),
    carries=("cameras", "image points", "control", "check points", "strips", "film"),
    page="docs/formats.md#pair-files",
    files_of=all_files,
)
GAMA = _format(
    "gama",
    "GNU Gama network",
    _gama,
    "XML with <gama-local>",
    read_gama,
    carries=("control", "start values of points", "geodetic observations", "standard deviations", "covariances"),
    page="docs/formats.md#gnu-gama-networks",
)
