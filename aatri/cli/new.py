"""`aatri new`: write a pipeline.yaml to start from; with `--plugin` a stage of one's own and its test."""

import json
import re
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from aatri.cli.arguments.completion import complete_new_variant, complete_path
from aatri.cli.arguments.options import SourceSettings, complete, listed, one_of
from aatri.cli.new_from_text import ACCURACY, HEAD, PHOTOS, SEARCHED_GRAPH, WITH_START, path_from, with_options
from aatri.cli.terminal.console import NARRATED, narrate, reports_errors, say
from aatri.errors import ResourceError, SpecError


class BlockSource(StrEnum):
    """Where the block comes from."""

    simulate = "simulate"
    tables = "tables"
    film = "film"
    reduced = "reduced"
    sample = "sample"
    unordered = "unordered"
    wucaps = "wucaps"
    dbat = "dbat"
    bal = "bal"
    colmap = "colmap"
    photos = "photos"


_COMMENTS = {
    BlockSource.tables: """\
# Digital images in strips, measured in pixels: fill in block.yaml, images.csv ... in the folder `block` beside this
# file.
""",
    BlockSource.film: """\
# Film in strips with measured fiducial marks: fill in block.yaml, images.csv, fiducials.csv ... in the folder `block`
# beside this file. Two or three marks: interior_orientation/similarity.
""",
    BlockSource.reduced: """\
# Photo coordinates in mm, reduced already: fill in block.yaml, images.csv ... in the folder `block` beside this file.
# Refraction and earth curvature are off, as they usually are corrected then; lens distortion is what block.yaml says.
""",
    BlockSource.unordered: """\
# Digital images of any arrangement, given as tables without strips or order: fill in block.yaml, images.csv ... in the
# folder `block` beside this file. Refraction and earth curvature are corrected in near-vertical images only.
# Without control and positions add `datum: free` to `with:` of the bundle.
""",
    BlockSource.wucaps: """\
# A block given as WuCAPS files (camera, image coordinates, control, orientation points) in the folder `block` beside
# this file. Refraction and earth curvature are off: such image coordinates usually are corrected already.
""",
    BlockSource.dbat: """\
# A PhotoModeler export and its control points, as DBAT takes them: put export.txt and control.txt beside this file.
# It has start values of all photos, so that interior orientation and bundle are enough.
""",
    BlockSource.bal: """\
# A problem of Bundle Adjustment in the Large: put the unpacked file problem.txt beside this file. It has no datum.
""",
    BlockSource.colmap: """\
# A sparse model of COLMAP: put cameras, images and points3D (.txt or .bin) into the folder `sparse` beside this file.
# It has no datum; with `control: ground_points.csv` at the block, leave out `datum` of the bundle.
""",
}
_WITH_START = {
    BlockSource.dbat: ("{use: block/dbat, with: {path: export.txt, control: control.txt}}", []),
    BlockSource.bal: ("{use: block/bal, with: {path: problem.txt}}", ["datum: minimal"]),
    BlockSource.colmap: ("{use: block/colmap, with: {path: sparse}}", ["datum: minimal"]),
}
"""Blocks with start values of all images: how they are read, and the options of their bundle."""
_TABLES = {"block": "{use: block/tables, with: {path: block}}"}
_CALIBRATED = {"interior": "{use: interior_orientation/calibrated, from: {block}}"}
_CORRECTED = {
    "refined": "{use: image_refinement/systematic, from: {block, image_points: interior}, "
    "with: {refraction: false, earth_curvature: false}}"
}
_LINES = {
    BlockSource.tables: {**_TABLES, **_CALIBRATED},
    BlockSource.film: _TABLES,
    BlockSource.reduced: {**_TABLES, **_CALIBRATED, **_CORRECTED},
    BlockSource.wucaps: {"block": "{use: block/wucaps, with: {path: block}}", **_CALIBRATED, **_CORRECTED},
}
"""What the lines of the demo become: stage -> text."""
_IMAGES = {
    BlockSource.tables: "digital",
    BlockSource.unordered: "digital",
    BlockSource.film: "film",
    BlockSource.reduced: "reduced",
}
"""Blocks whose folder is written to be filled in, and what their images are."""


MorePaths: TypeAlias = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="PATH...",
        autocompletion=complete_path,
        help="With --block photos: the folder of the photographs; with --from: more files and folders.",
    ),
]
Source: TypeAlias = Annotated[
    BlockSource | None,
    typer.Option(
        parser=one_of(BlockSource),
        autocompletion=complete(BlockSource),
        metavar="NAME",
        help=f"Where the block comes from: {listed(BlockSource)}; without --from by default simulate.",
    ),
]
OtherPrograms: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option(
        "--from",
        metavar="PATH",
        autocompletion=complete_path,
        help="Files or folders of another program, recognised by their content.",
    ),
]
Misfit: TypeAlias = Annotated[
    float | None,
    typer.Option(min=0, help="With --from: largest misfit, px, of a distortion that is none of aatri's."),
]
Without: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="FILE", autocompletion=complete_path, help="With --from: leave out a file of a folder."),
]
Plugin: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="ROLE/NAME",
        autocompletion=complete_new_variant,
        help="Write a stage of your own and its test instead.",
    ),
]


@reports_errors
def new(
    folder: Annotated[Path, typer.Argument(autocompletion=complete_path, help="Folder to write to.")] = Path(),
    paths: MorePaths = None,
    block: Source = None,
    sources: OtherPrograms = None,
    lens_misfit: Misfit = None,
    set_: SourceSettings = None,
    without: Without = None,
    plugin: Plugin = None,
) -> None:
    """Write a pipeline.yaml to start from: the demo, or one for a block of your own; or a stage of your own."""
    if plugin is not None:
        from aatri.cli.new_plugin import plugin_files

        if paths or sources or block or set_ or without or lens_misfit is not None:
            raise SpecError("--plugin beside a block", remedy="one call for the stage, another for the pipeline")
        _write(plugin_files(plugin, folder))
        narrate(f"next: pytest {folder / 'tests'}, then aatri run --local-plugins with `use: {plugin}`")
        return
    if paths and not sources and (len(paths) > 1 or block is not BlockSource.photos):
        raise SpecError(f"a second path, {paths[-1]}", remedy="--from takes several, --block photos one")
    if sources and block is not None:
        raise SpecError(f"--block {block} beside --from", remedy="--from reads what there is: leave --block out")
    if (set_ or without or lens_misfit is not None) and not sources:
        what = "--set, --without and --lens-misfit go with --from"
        raise SpecError(what, remedy="or change the pipeline.yaml that is written")
    if sources:
        _check_folder(folder, sources)
    block = block or BlockSource.simulate
    written = folder / "pipeline.yaml"
    if sources:
        from aatri.cli.new_from import pipeline_from
        from aatri.formats.registry.settings import Setting, settings_of

        misfit = [] if lens_misfit is None else [Setting("", "lens_misfit_px", lens_misfit)]
        text = pipeline_from(
            [*sources, *(paths or ())], folder, [*misfit, *settings_of(set_ or ())], without=without or ()
        )
        _write({written: text})
        _refuse_as_a_run(written)
    else:
        _write({written: _text(block, folder, next(iter(paths or ()), None)), **_tables(block, folder)})
    where = "" if folder == Path() else f" {written}"
    complete = sources or paths or block in (BlockSource.simulate, BlockSource.sample)
    fill = "" if complete else f"your data, as the head of {written} says, then aatri check{where}, then "
    narrate(f"next: {fill}aatri run{where}")


def _check_folder(folder: Path, sources: Sequence[Path]) -> None:
    """Refuse what looks like another source as the folder to write to: of `--from A B` the command line takes B so."""
    if folder == Path() or (folder / "pipeline.yaml").exists():
        return
    if folder.is_file():
        what = "is a file, not a folder to write to"
    elif any(folder.resolve() in path.resolve().parents for path in sources) or not _has_files(folder):
        return
    else:
        what = "holds files, but no pipeline.yaml, and none of the files after --from"
    remedy = "FOLDER comes before --from: `aatri new FOLDER --from A B C`; to write into this folder, change to it"
    raise SpecError(what, where=str(folder), remedy=remedy)


def _has_files(folder: Path) -> bool:
    entries = [path for path in folder.iterdir() if not path.name.startswith(".")] if folder.is_dir() else []
    return any(path.is_file() for path in entries) or any(_has_files(path) for path in entries)


def _refuse_as_a_run(pipeline: Path) -> None:
    """Read the block as a run will: what that refuses is refused at once, what it warns of is shown, in its words.

    The pipeline stays, as an option or an edit in it may be the remedy.
    """
    from aatri.cli.block_reading import block_reading
    from aatri.pipeline.methods.catalogue import Catalogue
    from aatri.pipeline.methods.compile_kernels import without_compiler
    from aatri.pipeline.plan.graph import wire
    from aatri.pipeline.run.workers import share_cores
    from aatri.pipeline.spec.pipeline_file import load_spec

    share_cores(1)
    spec = load_spec(pipeline)
    reading = block_reading(spec, without_compiler(wire, spec, Catalogue()))
    for text in reading.warnings:
        narrate(f"warning: {text}")
    if reading.error is not None:
        text = f"{pipeline} is written; as it stands, a run of it is refused for what follows: edit the file, or remove"
        narrate(f"{text} it before `aatri new` is repeated with other options")
        raise reading.error


def _tables(block: BlockSource, folder: Path) -> dict[Path, str]:
    """Tables beside the pipeline: those of the sample, or some to be filled in."""
    from aatri.cli.new_block import block_templates, sample_folder

    if block in _IMAGES:
        return block_templates(folder / "block", _IMAGES[block])
    if block is not BlockSource.sample:
        return {}
    tables = sorted((sample_folder() / "quarry").iterdir())
    return {folder / "quarry" / path.name: path.read_text(encoding="utf-8") for path in tables}


def _write(files: Mapping[Path, str]) -> None:
    """Write new files, or none where one is there already; their paths are the result."""
    for path in files:
        if path.exists():
            raise SpecError("is there already", where=str(path), remedy="another folder, or remove it first")
    for path, text in files.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise ResourceError(f"cannot write: {error.strerror}", where=str(path)) from error
        say(str(path))


def _text(block: BlockSource, folder: Path, photographs: Path | None) -> str:
    from aatri.cli.new_block import demo_path, sample_folder

    demo = demo_path().read_text(encoding="utf-8")
    if block is BlockSource.simulate:
        return demo
    if block is BlockSource.sample:
        return (sample_folder() / "pipeline.yaml").read_text(encoding="utf-8")
    if block is BlockSource.unordered:
        return _COMMENTS[block] + HEAD + "  block:    {use: block/tables, with: {path: block}}\n" + SEARCHED_GRAPH
    if block is BlockSource.photos:
        path = json.dumps(path_from(photographs or folder / "photos", folder), ensure_ascii=False)
        text = PHOTOS.replace("@PATH@", path)
        if photographs is None or _have_positions(photographs):
            return text
        narrate("the photographs have no positions: a free model, without a place and a scale (`datum: free`)")
        return text.replace("with: {blunders", "with: {datum: free, blunders")
    if block in _WITH_START:
        read, options = _WITH_START[block]
        return f"{_COMMENTS[block]}{HEAD}  block:    {read}\n{with_options(WITH_START + ACCURACY, options)}"
    body = demo[demo.index("run:") :].replace("runs/demo", "runs/block")
    for stage, value in _LINES[block].items():
        body = re.sub(rf"^(  {stage}: +).*$", rf"\g<1>{value}", body, flags=re.MULTILINE)
    return _COMMENTS[block] + body


def _have_positions(photographs: Path) -> bool:
    """Whether one of the photographs has a position; says what their heads hold."""
    from aatri.cli.new_from import counted
    from aatri.formats.parts.format import Reading
    from aatri.formats.registry.sources import read_source

    parts = read_source(photographs, Reading(format="photos"), NARRATED)
    narrate(f"{photographs}: {', '.join(counted(parts)) or 'nothing of a block'}")
    return bool(parts.exterior)
