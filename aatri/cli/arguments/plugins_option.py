"""The option `--local-plugins`, the same for every verb that needs stages."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

FOLDER = "stages"

LocalPlugins: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--local-plugins", help="Use the stages in the folder `stages` beside the pipeline too; runs their code."
    ),
]
"""Annotation of the parameter `local_plugins: LocalPlugins = False` of a verb."""


def local_stages(asked: bool, pipeline: Path = Path("pipeline.yaml")) -> Path | None:
    """The project's own folder of stages, as `find_stages` takes it; None if it was not asked for."""
    return pipeline.parent / FOLDER if asked else None
