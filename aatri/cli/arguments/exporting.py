"""What the verbs that write other programs' files have in common: the folder, the options, and what is told of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.cli.terminal.console import narrate, say
from aatri.errors import SpecError

if TYPE_CHECKING:
    from aatri.formats.results.oriented_block import OrientedBlock


def complete_written(incomplete: str) -> list[str]:
    """Formats that are written, for the shell."""
    from aatri.formats.registry.export import written_formats

    return [name for name in written_formats() if name.startswith(incomplete)]


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that holds something, or through which something else would be written.

    Raises
    ------
    SpecError
    """
    if folder.exists() and not folder.is_dir():
        raise SpecError("not a folder", where=str(folder))
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise SpecError("the folder is not empty", where=str(folder), remedy="another folder, or --overwrite")
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            what = "is a link or no file, and would be written through"
            raise SpecError(what, where=str(path), remedy="remove it, or another folder")


def write_format(
    format: str, oriented: OrientedBlock, folder: Path, options: Mapping[str, object], *, what: str
) -> None:
    """Write a format into a folder, and tell what it could not carry."""
    from pydantic import ValidationError

    from aatri.cli.terminal.console import NARRATED
    from aatri.formats.parts.format import Writing
    from aatri.formats.registry.export import write_as, written_format

    try:
        writing = Writing.model_validate({name: value for name, value in options.items() if value is not None})
    except ValidationError as error:
        fault = error.errors()[0]
        raise SpecError(f"--{fault['loc'][0]}: {fault['msg']}") from error
    write_as(written_format(format), oriented, folder, writing, NARRATED)
    narrate(f"{what} written as {format}")
    say(str(folder))
