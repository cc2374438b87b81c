"""What Pix4D's parameters are recognised by, and what they carry."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts

HEAD = "fileName imageWidth imageHeight"


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.pix4d.reader import read_pix4d

    return read_pix4d(path, reporter, allowed_px=reading.lens_misfit_px)


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return f"a first line {HEAD}" if view.head.startswith(HEAD) else ""
    ending = "calibrated_camera_parameters.txt"
    return next((name for name in view.names if name.endswith(ending) and _recognised(view.of(name))), "")


def _files(view: FileView) -> list[Path]:
    return [view.path / name for name in view.names] if view.is_folder else [view.path]


PIX4D = Format(
    "pix4d", "Pix4D parameters", _recognised, "`*_calibrated_camera_parameters.txt`",
    carries=("cameras", "distortion", "start orientations"),
    drops=("image points", "control", "standard deviations", "frame", "strips", "times", "rigs", "film"),
    page="docs/formats.md#pix4d-parameters", read=_read, files_of=_files,
)  # fmt: skip
