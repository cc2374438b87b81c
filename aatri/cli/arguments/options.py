"""Arguments and options that several verbs have, as annotations of their parameters: `json: AsJson = False`.

Of an argument that is one of a few names the nearest is told where it is none; the shell completes them.
"""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeAlias, TypeVar

import typer

from aatri.cli.arguments.completion import (
    complete_list_columns,
    complete_method,
    complete_path,
    complete_run,
    complete_setting,
    complete_source_setting,
    complete_variant,
    one_of_words,
)
from aatri.ids import clipped, did_you_mean

Names = TypeVar("Names", bound=StrEnum)

FOLDER = "stages"
ROTATIONS = ("omega-phi-kappa", "phi-omega-kappa", "yaw-pitch-roll")

LocalPlugins: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--local-plugins", help="Use the stages in the folder `stages` beside the pipeline too; runs their code."
    ),
]
RunArgument: TypeAlias = Annotated[
    Path | None,
    typer.Argument(help="Run folder or pipeline file; default ./pipeline.yaml.", autocompletion=complete_run),
]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="As JSON.")]
Overwrite: TypeAlias = Annotated[bool, typer.Option(help="Write into a folder that is not empty.")]
ListColumns: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--columns",
        autocompletion=complete_list_columns,
        help="Of lists: a preset (pix4d, metashape ...), or the columns in order.",
    ),
]
ListAngle: TypeAlias = Annotated[
    str | None,
    typer.Option("--angle", autocompletion=one_of_words("deg", "gon", "rad"), help="Of lists: deg, gon or rad."),
]
ListRotation: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--rotation",
        autocompletion=one_of_words(*ROTATIONS),
        help="Of lists: omega-phi-kappa, phi-omega-kappa or yaw-pitch-roll.",
    ),
]
LensMisfit: TypeAlias = Annotated[
    float, typer.Option("--lens-misfit", min=0, help="Largest misfit, px, of a distortion that the target lacks.")
]
Into: TypeAlias = Annotated[
    Path | None,
    typer.Option(help="Folder of the results instead of `run:`.", metavar="DIR", autocompletion=complete_path),
]
Several: TypeAlias = list[str] | None
Settings: TypeAlias = Annotated[
    Several,
    typer.Option(
        "--set", metavar="STAGE.OPTION=VALUE", autocompletion=complete_setting, help="Set an option; may be repeated."
    ),
]
SourceSettings: TypeAlias = Annotated[
    Several,
    typer.Option(
        "--set",
        metavar="[SOURCE:]KEY=VALUE",
        autocompletion=complete_source_setting,
        help="What no file says: crs, geoid, columns, maps ... of a source; control_sigma, image_sigma_px ... "
        "of the block. `aatri stages block/combined` lists all. May be repeated.",
    ),
]
Methods: TypeAlias = Annotated[
    Several,
    typer.Option(metavar="STAGE=ROLE/VARIANT", autocompletion=complete_method, help="Swap a method; may be repeated."),
]
Variant: TypeAlias = Annotated[
    str, typer.Option(metavar="NAME", autocompletion=complete_variant, help="A variant of the pipeline file.")
]
OpenReport: TypeAlias = Annotated[bool, typer.Option("--open", help="Open the report in the browser.")]
NoLock: TypeAlias = Annotated[bool, typer.Option("--no-lock", help="For file systems without locks.")]
Debug: TypeAlias = Annotated[bool, typer.Option(help="Show tracebacks.")]
Verify: TypeAlias = Annotated[bool, typer.Option(help="Read every file again instead of trusting size and times.")]


def one_of(names: type[Names]) -> Callable[[str], Names]:
    """A parser of an argument that is one of some names."""

    def parse(text: str) -> Names:
        values = [name.value for name in names]
        if text not in values:
            raise typer.BadParameter(f"{clipped(text)!r} is none of {', '.join(values)}{did_you_mean(text, values)}")
        return names(text)

    return parse


def complete(names: type[StrEnum]) -> Callable[[str], list[str]]:
    """What the shell offers of the names."""
    return lambda incomplete: [name.value for name in names if name.value.startswith(incomplete)]


def listed(names: type[StrEnum]) -> str:
    """The names for the help."""
    return ", ".join(name.value for name in names)


def local_stages(asked: bool, pipeline: Path = Path("pipeline.yaml")) -> Path | None:
    """The project's own folder of stages, as `find_stages` takes it; None if it was not asked for."""
    return pipeline.parent / FOLDER if asked else None
