"""What a project of OPF is recognised by, and what it carries."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock

PROJECT = "application/opf-project+json"


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.opf.reader import read_opf

    return read_opf(path, reporter, allowed_px=reading.lens_misfit_px)


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.opf.writer import write_opf

    write_opf(oriented, folder, writing, reporter)


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return f"JSON of the format {PROJECT}" if f'"{PROJECT}"' in view.head[:4096] else ""
    return next((name for name in view.names if name.endswith(".opf") and _recognised(view.of(name))), "")


def _files(view: FileView) -> list[Path]:
    return [p for p in view.path.rglob("*") if p.is_file()] if view.is_folder else [view.path]


OPF = Format(
    "opf", "OPF project", _recognised, f"`project.opf`, JSON of the format {PROJECT}",
    carries=("cameras", "distortion", "image points", "control", "check points", "positions", "start orientations",
             "frame", "standard deviations"),
    drops=("attitudes", "strips", "times", "covariances", "rigs", "film"),
    page="docs/formats.md#opf", read=_read, files_of=_files, write=_write,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points", "positions",
             "start orientations", "frame", "standard deviations"),
)  # fmt: skip
