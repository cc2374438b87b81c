"""What sparse models are recognised by, and what they carry."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock


def _read_nvm(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:  # noqa: ARG001
    from aatri.formats.nvm.nvm_reader import read_nvm

    return read_nvm(path, reporter)


def _read_bundler(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:  # noqa: ARG001
    from aatri.formats.nvm.bundler_reader import read_bundler

    return read_bundler(path, reporter)


def _write_nvm(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.nvm.nvm_writer import write_nvm

    write_nvm(oriented, folder, writing, reporter)


def _begins(view: FileView, words: str) -> str:
    return f"a first line {words}" if view.head.startswith(words) else ""


NVM = Format(
    "nvm", "VisualSFM NVM", lambda view: _begins(view, "NVM_V3"), "a first line NVM_V3",
    carries=("cameras", "distortion", "image points", "start orientations", "start values of points"),
    drops=("control", "standard deviations", "frame", "strips", "times", "rigs", "film"),
    page="docs/formats.md#nvm-and-bundler", read=_read_nvm, write=_write_nvm,
    written=("cameras", "distortion", "image points", "start orientations", "start values of points"),
)  # fmt: skip
BUNDLER = Format(
    "bundler", "Bundler bundle.out", lambda view: _begins(view, "# Bundle file v0.3"), "a line `# Bundle file v0.3`",
    carries=("cameras", "distortion", "image points", "start orientations", "start values of points"),
    drops=("control", "standard deviations", "frame", "strips", "times", "rigs", "film"),
    page="docs/formats.md#nvm-and-bundler", read=_read_bundler,
)  # fmt: skip
