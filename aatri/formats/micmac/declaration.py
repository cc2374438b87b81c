"""What files of MicMac are recognised by, and what they carry."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock

LOOKED_FOR = "XML with `ExportAPERO`, `MMVII_Serialization`, `DicoAppuisFlottant` or `SetOfMesureAppuisFlottants`"
WORDS = ("<ExportAPERO", "MMVII_Serialization", "<DicoAppuisFlottant", "<SetOfMesureAppuisFlottants")


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.micmac.reader import read_micmac

    return read_micmac(path, reporter, allowed_px=reading.lens_misfit_px)


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.micmac.writer import write_micmac

    write_micmac(oriented, folder, writing, reporter)


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return next((f"XML with {word.strip('<')}" for word in WORDS if word in view.head), "")
    xml = [name for name in view.names if name.lower().endswith(".xml")]
    seen = next((name for name in xml if _recognised(view.of(name))), "")
    folders = [name for name in view.names if name.startswith("Ori-") or name == "MMVII-PhgrProj"]
    return f"{seen}, {_recognised(view.of(seen))}" if seen else ", ".join(folders)


def _files(view: FileView) -> list[Path]:
    return [view.path / name for name in view.names] if view.is_folder else [view.path]


MICMAC = Format(
    "micmac", "MicMac and MMVII", _recognised, LOOKED_FOR,
    carries=("cameras", "distortion", "image points", "control", "standard deviations", "covariances",
             "start orientations"),
    drops=("check points", "strips", "times", "frame", "rigs", "film"),
    page="docs/formats.md#micmac", read=_read, files_of=_files, write=_write,
    written=("cameras", "distortion", "image points", "control", "start orientations"),
)  # fmt: skip
