"""A small simulated block, its pipelines and the command line, as a user has them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from typer.testing import CliRunner, Result

from aatri.cli.main import app

SIMULATE = (
    "use: block/simulate, with: {preset: rc30, flight: {strips: 2, images_per_strip: 5, cross_strips: 0},"
    " ties: {new_points: 120}, known: {full: 10, check_full: 4}}"
)
TABLES = "use: block/tables, with: {path: block}"
STAGES = """\
  interior:    {use: interior_orientation/affine, from: {block}}
  refined:     {use: image_refinement/systematic, from: {block, image_points: interior}}
  models:      {use: relative_orientation/dependent, from: {block, image_points: refined}}
  strips:      {use: strip_formation/scale_transfer, from: {block, models}}
  absolute:    {use: absolute_orientation/similarity, from: {block, strips, image_points: refined}}
  strip_block: {use: strip_adjustment/polynomial,
                from: {block, image_points: refined, strips, models, initial: absolute}}
  bundle:      {use: bundle_adjustment/bundle, from: {block, image_points: refined, initial: strip_block},
                with: {interior_unknowns: true}}
  accuracy:    {use: accuracy/evaluation, from: {block, solution: bundle}}
"""

Edit = Callable[[Path], None]
"""A change of a block folder."""


def aatri(*arguments: str | Path) -> Result:
    """Run the command line; a traceback of the stages would come out as text, one of ours as an exception."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def write_pipeline(folder: Path, block: str, stages: str = STAGES) -> Path:
    """Write a pipeline whose results go to `folder/run`."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "pipeline.yaml"
    path.write_text(f"run: run\nseed: 1\nstages:\n  block:       {{{block}}}\n{stages}")
    return path


def current(folder: Path) -> set[str]:
    """Stages with a current artifact, current record, or both."""
    return {path.stem for path in (folder / "run" / "current").glob("*")}


def lines(name: str, change: Callable[[str], str | None], more: str = "") -> Edit:
    """Edit a table line by line, None removing the line; the header stays."""

    def edit(block: Path) -> None:
        header, *rows = (block / name).read_text().splitlines()
        kept = [line for line in map(change, rows) if line is not None]
        (block / name).write_text("\n".join([header, *kept]) + "\n" + more)

    return edit


def without(name: str) -> Edit:
    """Remove a table."""
    return lambda block: (block / name).unlink()
