"""The one way out: an oriented block as files of a format, and what the format has no place for."""

from collections.abc import Sequence
from pathlib import Path

from aatri.errors import SpecError
from aatri.formats.parts.format import Format, Writing
from aatri.formats.registry.catalogue import BY_NAME, FORMATS
from aatri.formats.results.exported_files import lost, write_crs
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.ids import clipped, did_you_mean
from aatri.progress import Reporter


def written_formats() -> list[str]:
    """Names of the formats that are written."""
    return [f.name for f in FORMATS if f.write]


def written_format(name: str, others: Sequence[str] = ()) -> Format:
    """A format that is written; `others` are names beside them, for the message.

    Raises
    ------
    SpecError
        If it is none, or read alone.
    """
    written = [*others, *written_formats()]
    if name not in BY_NAME:
        what = f"no format {clipped(name)!r}{did_you_mean(name, written)}"
        raise SpecError(what, remedy=f"one of {', '.join(written)}")
    if BY_NAME[name].write is None:
        raise SpecError(f"{BY_NAME[name].title} is read, not written", remedy=f"written are {', '.join(written)}")
    return BY_NAME[name]


def write_as(declared: Format, oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    """Write an oriented block; what the format has no place for is told.

    Parameters
    ----------
    declared : Format
        One that is written.
    folder : Path
        Made if it is not there.

    Raises
    ------
    InputError
        If the block has no such form; nothing is written then.
    ResourceError
        If a file cannot be written.
    """
    if declared.write is None:
        raise ValueError(f"{declared.name} is not written")
    declared.write(oriented, folder, writing, reporter)
    if "frame" not in declared.written:
        write_crs(oriented.block, folder)
    if absent := lost(oriented, declared.written):
        reporter.log(f"{declared.title} has no place for: {', '.join(absent)}")
