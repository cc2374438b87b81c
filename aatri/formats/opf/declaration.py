"""What a project of OPF is recognised by, and what it carries."""

import re
from pathlib import Path

from aatri.formats.opf.project import PROJECT
from aatri.formats.opf.reader import read_opf
from aatri.formats.opf.writer import write_opf
from aatri.formats.parts.format import FileView, Format

_STATED = re.compile(rf'"format"\s*:\s*"{re.escape(PROJECT)}"')  # the schema of OPF has the words elsewhere


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return f"JSON of the format {PROJECT}" if _STATED.search(view.head[:4096]) else ""
    return next((name for name in view.names if name.endswith(".opf") and _recognised(view.of(name))), "")


def _files(view: FileView) -> list[Path]:
    return [p for p in view.path.rglob("*") if p.is_file()] if view.is_folder else [view.path]


OPF = Format(
    "opf", "OPF project", _recognised, f"`project.opf`, JSON of the format {PROJECT}",
    carries=("cameras", "distortion", "image points", "control", "check points", "positions", "attitudes",
             "start orientations", "frame", "standard deviations", "rigs"),
    page="docs/formats.md#opf", read=read_opf, files_of=_files, write=write_opf,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points", "positions",
             "start orientations", "frame", "standard deviations"),
    estimates_cameras=True,
)  # fmt: skip
