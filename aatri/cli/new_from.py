"""`aatri new MINE --from PATH`: a pipeline for files of other programs, recognised by their content.

What is there decides: with start values of all images a bundle follows the block at once; without them strips, where
all images have one, else the graph of the images. Without control and observed positions the datum is free. Cameras
that the other program has estimated from the same image points are start values of a self-calibration; standard
deviations of image points that no file states are estimated.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.cli.terminal.console import NARRATED, narrate
from aatri.codes import CONTROL, OBSERVED_VALUE
from aatri.errors import InputError

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.registry.recognised import Recognised

FEWEST_RAYS = 3
"""Image points by which an image is oriented."""
FEWEST = 3
"""Control points or positions that are a datum."""

CALIBRATED = "self_calibration: {set: brown_conrady, remove: true}"
"""As programs of computer vision have it; what the block does not determine is taken out."""
COMPONENTS = "variance_components: {groups: [kind], apply: true}"
"""Where no file states standard deviations of image points: they come from the residuals."""
MAY_BE_OBSERVED = """\
      # positions of the files are start values; of measured ones say `use: observed` beside their path, and here:
      # position_sigma: [0.1, 0.1, 0.1]   # m
      # attitude_sigma_deg: 0.01
"""
INTERIOR = "  interior: {use: interior_orientation/calibrated, from: {block}}\n"
REFINED = """\
  refined:  {use: image_refinement/systematic, from: {block, image_points: interior},
             with: {refraction: false, earth_curvature: false}}
"""
ACCURACY = "  accuracy: {use: accuracy/evaluation, from: {block, solution: bundle}}\n"
WITH_START = f"""\
  # the files have start values of every image, so that the adjustment begins with them
{INTERIOR}  bundle:   {{use: bundle_adjustment/bundle, from: {{block, image_points: interior}}{{with}}}}
"""
NETWORK = "  # no images: a network\n  bundle:   {use: bundle_adjustment/bundle, from: {block}{with}}\n"
OF_GRAPH = f"""\
  # images without start values and without strips: oriented along the graph of their pairs
{INTERIOR}{REFINED}\
  initial:  {{use: initial_orientation/graph, from: {{block, image_points: refined}}}}
  bundle:   {{use: bundle_adjustment/bundle, from: {{block, image_points: refined, initial}}{{with}}}}
"""
OF_STRIPS = f"""\
  # strips without start values: models, strips, their orientation by control, then the bundle
{INTERIOR}{REFINED}\
  models:   {{use: relative_orientation/dependent, from: {{block, image_points: refined}}}}
  strips:   {{use: strip_formation/scale_transfer, from: {{block, models}}}}
  absolute: {{use: absolute_orientation/similarity, from: {{block, image_points: refined, strips}}}}
  bundle:   {{use: bundle_adjustment/bundle, from: {{block, image_points: refined, initial: absolute}}{{with}}}}
"""


def pipeline_from(paths: Sequence[Path], folder: Path, *, lens_misfit_px: float | None = None) -> str:
    """The text of a pipeline for some files and folders; what was found is told.

    Parameters
    ----------
    paths : sequence of Path
    folder : Path
        Where the pipeline will be: paths are relative to it.
    lens_misfit_px : float, optional
        Largest misfit of a distortion that is none of aatri's; None: the least that needs no leave.

    Raises
    ------
    InputError
        If a path is of no known format, or something is missing that a block cannot do without; the message names it.
    """
    import numpy as np

    from aatri.formats.parts.assembled import assembled
    from aatri.formats.parts.format import Reading
    from aatri.formats.registry.sources import read_all

    said = {} if lens_misfit_px is None else {"lens_misfit_px": lens_misfit_px}
    sources, parts = read_all(paths, Reading.model_validate(said), NARRATED)
    alone = len(sources) == 1 and bool(sources[0].format.stage)
    if not parts:
        return _text(sources, folder, _with(OF_STRIPS, []))
    for of_source in parts:
        narrate(f"  {of_source.format}: {', '.join(_counted(of_source)) or 'nothing of a block'}")
        for note in of_source.notes:
            narrate(f"    {note}")
    if alone and "geodetic" in parts[0].others and not parts[0].images:
        return _text(sources, folder, _of_network(bool(np.isin(parts[0].ground_points.get("role", 0), CONTROL).any())))
    block = assembled([replace(of_source, notes=[]) for of_source in parts], reporter=NARRATED)
    lacking = _lacking(block)
    narrate(f"block {block.name}: " + ", ".join(f"{v} {k.replace('_', ' ')}" for k, v in block.metrics().items() if v))
    if lacking:
        narrate(f"missing: {', '.join(lacking)}")
    _check_enough(block, str(paths[0]))
    stages = _stages(block, _options(block, sources, parts))
    if len(block.fiducial_points):  # film on a comparator
        stages = stages.replace("interior_orientation/calibrated", "interior_orientation/affine")
    observed = (block.exterior.position_use == OBSERVED_VALUE).any()
    positions = len(block.exterior) and any("positions" in s.format.carries for s in sources)
    hint = MAY_BE_OBSERVED if positions and not observed else ""
    return _text(sources, folder, stages, hint, "".join(f", {key}: {value:g}" for key, value in said.items()))


def _check_enough(block: Block, where: str) -> None:
    """Refuse images that nothing orients: without image points, or with too few and no observed position."""
    import numpy as np

    images, points = len(block.images), len(block.image_points)
    enough = np.bincount(block.image_points.image, minlength=images) >= FEWEST_RAYS
    oriented = enough.copy()
    oriented[block.exterior.image[block.exterior.position_use == OBSERVED_VALUE]] = True
    if not images or (points and oriented.sum() >= min(2, images)):
        return
    what = f"there are {images} images, but no image points"
    if points:
        what = f"{points} image points in {images} images, {FEWEST_RAYS} and more in {int(enough.sum())}"
    remedy = "add the file with the image points (tracks.csv, marks, tie points) as a further --from"
    raise InputError(what, where=where, remedy=remedy)


def _counted(parts: BlockParts) -> list[str]:
    tables = ("cameras", "images", "image_points", "ground_points", "exterior")
    keys = ("id", "id", "image", "point", "image")
    words = ("cameras", "images", "image points", "ground points", "positions or attitudes")
    counts = [len(getattr(parts, table).get(key, ())) for table, key in zip(tables, keys)]
    frame = [f"frame {parts.frame.crs}"] if parts.frame is not None else []
    return [f"{count} {word}" for count, word in zip(counts, words) if count] + frame


def _has_start(block: Block) -> bool:
    import numpy as np

    e = block.exterior
    full = np.isfinite(e.position_m).all(axis=1) & np.isfinite(e.angles_rad).all(axis=1)
    return len(np.unique(e.image[full])) == len(block.images)


def _has_datum(block: Block) -> bool:
    metrics = block.metrics()
    return max(int(metrics["control_points"] or 0), int(metrics["exterior_observations"] or 0)) >= FEWEST


def _lacking(block: Block) -> list[str]:
    """What a block may have and this one does not."""
    has = {
        "start values of all images": not len(block.images) or _has_start(block),
        "control or observed positions": _has_datum(block),
        "check points": bool(block.metrics()["check_points"]),
        "a coordinate system": block.frames.crs[0] != "local",
    }
    return [what for what, there in has.items() if not there]


def _options(block: Block, sources: Sequence[Recognised], parts: Sequence[BlockParts]) -> list[str]:
    """Options of a bundle by what the files do not know: cameras, and standard deviations of image points."""
    formats = {s.format.name: s.format for s in sources}
    cameras = [formats[p.format] for p in parts if p.cameras and p.format in formats]
    points = [formats[p.format] for p in parts if p.image_points and p.format in formats]
    # a camera of an image or two is not determined by them: it keeps what the program has estimated
    calibrated = any(f.estimates_cameras for f in cameras) and len(block.images) > 2 * len(block.cameras)
    assumed = any("standard deviations" not in f.carries for f in points)
    return [CALIBRATED] * calibrated + [COMPONENTS] * assumed


def _stages(block: Block, options: list[str]) -> str:
    """The stages after the block; `options` of its bundle."""
    if not len(block.images):
        return _of_network(_has_datum(block))
    if _has_start(block):
        return _with(WITH_START + ACCURACY, [*["datum: minimal"] * (not _has_datum(block)), *options])
    if (block.images.strip >= 0).all() and _has_datum(block):
        return _with(OF_STRIPS + ACCURACY, options)
    return _with(OF_GRAPH + ACCURACY, [*["datum: free"] * (not _has_datum(block)), *options])


def _of_network(has_datum: bool) -> str:
    return _with(NETWORK, [] if has_datum else ["datum: free, datum_over: marked"])


def _with(stages: str, options: Sequence[str]) -> str:
    """The stages, the bundle with its options."""
    return stages.replace("{with}", f", with: {{{', '.join(options)}}}" if options else "")


def _text(sources: Sequence[Recognised], folder: Path, stages: str, hint: str = "", said: str = "") -> str:
    """The pipeline with the line that reads the block; a hint on its options, and what is said of each source."""
    named = [(s, json.dumps(path_from(s.path, folder), ensure_ascii=False)) for s in sources]
    if len(sources) == 1 and sources[0].format.stage:
        block = f"  block:    {{use: {sources[0].format.stage}, with: {{path: {named[0][1]}}}}}\n"
    else:
        lines = "".join(
            f"        - {{path: {path}, format: {s.format.name}{said}}}   # {s.format.title}\n" for s, path in named
        )
        block = (
            "  block:\n    use: block/combined\n    with:\n"
            "      # what no file says, with the values taken: aatri stages block/combined lists all options\n"
            "      image_sigma_px: 1.0\n"
            "      control_sigma: [0.0, 0.0, 0.0]     # m, of control without a standard deviation; 0 is exact\n"
            f"{hint}"
            "      sources:                           # the first with images says which there are\n" + lines
        )
    count = f"{len(sources)} source{'s' * (len(sources) != 1)}"
    return f"# Written by aatri new --from; {count}.\nrun: runs/block\nseed: 1\nstages:\n{block}{stages}"


def path_from(path: Path, folder: Path) -> str:
    """The path as the pipeline names it: relative to its folder."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
