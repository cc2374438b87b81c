"""`aatri convert SOURCE DIR --to FORMAT`: files of one program as those of another, without a run."""

from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_path
from aatri.cli.arguments.exporting import check_folder, complete_written, write_format
from aatri.cli.arguments.options import LensMisfit, ListAngle, ListColumns, ListRotation, Overwrite, SourceSettings
from aatri.cli.terminal.console import NARRATED, reports_errors
from aatri.errors import SpecError


@reports_errors
def convert(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="SOURCE...", autocompletion=complete_path, help="Files and folders of one block."),
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", autocompletion=complete_path, help="Folder to write to.")],
    to: Annotated[str, typer.Option("--to", autocompletion=complete_written, help="A format that is written.")],
    crs: Annotated[str | None, typer.Option(help="Coordinate system of sources that state none.")] = None,
    overwrite: Overwrite = False,
    columns: ListColumns = None,
    angle: ListAngle = None,
    rotation: ListRotation = None,
    lens_misfit: LensMisfit = 0.05,
    set_: SourceSettings = None,
) -> None:
    """Read files of other programs as one block, and write it for another, with the orientations that they have.

    Several sources are joined as by block/combined. What the target has no place for is told.
    """
    from aatri.formats.parts.assembled import assembled
    from aatri.formats.registry.export import written_format
    from aatri.formats.registry.settings import Setting, settings_of
    from aatri.formats.registry.sources import read_all
    from aatri.formats.results.oriented_block import OrientedBlock

    written_format(to)
    check_folder(folder, overwrite=overwrite)
    stated = [
        Setting("", "lens_misfit_px", lens_misfit),
        *([Setting("", "crs", crs)] if crs else []),
        *settings_of(set_ or ()),
    ]
    _, parts = read_all(sources, stated, NARRATED)
    if not parts:
        what = "is read by a stage of its own alone"
        raise SpecError(what, where=str(sources[0]), remedy="run it, and `aatri export` its block")
    block = assembled(parts, reporter=NARRATED)
    options = {"columns": columns, "angle": angle, "rotation": rotation, "lens_misfit_px": lens_misfit}
    write_format(to, OrientedBlock(block), folder, options, what=block.name)
