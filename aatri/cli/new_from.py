"""`aatri new MINE --from PATH`: a pipeline for files of other programs, recognised by their content.

What is there decides: with start values of all images a bundle follows the block at once; without them strips, where
all images have one, else the graph of the images. Without control and observed positions the datum is free. Cameras
that the other program has estimated from the same image points are start values of a self-calibration; standard
deviations of image points that no file states are estimated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.cli.new_beside import check_merged, is_network
from aatri.cli.new_from_text import (
    ACCURACY,
    NETWORK,
    OF_GRAPH,
    OF_STRIPS,
    UNCORRECTED,
    WITH_START,
    of_matched,
    pipeline_text,
    with_options,
)
from aatri.cli.terminal.console import NARRATED, narrate
from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError, SpecError
from aatri.geometry.limits import MIN_CONTROL, MIN_POINTS
from aatri.ids import amounts, did_you_mean, several

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.parts.not_stated import NotStated
    from aatri.formats.registry.settings import Setting, SourceWithSettings

ANGLES = {"angles_rad", "ground_from_image"}
"""Columns of attitudes that a source may have."""
CALIBRATED = "self_calibration: {set: brown_conrady, remove: true}"
"""As programs of computer vision have it; what the block does not determine is taken out."""
COMPONENTS = "variance_components: {groups: [kind], apply: true}"
"""Where no file states standard deviations of image points: they come from the residuals, against other kinds."""
MAY_BE_OBSERVED = """\
      # positions of the files are start values; of measured ones say `use: observed` beside their path, and here:
      # position_sigma: [0.1, 0.1, 0.1]   # m
      # attitude_sigma_deg: 0.01
"""


def pipeline_from(
    paths: Sequence[Path], folder: Path, settings: Sequence[Setting] = (), *, without: Sequence[str] = ()
) -> str:
    """The text of a pipeline for some files and folders; what they hold is told.

    Parameters
    ----------
    folder : Path
        Where the pipeline will be: paths are relative to it.
    settings : sequence of Setting
        Options of the sources and of the block.
    without : sequence of str
        Files that are left out, by the ends of their paths.

    Raises
    ------
    InputError
        If a path is of no known format, or something is missing that a block cannot do without; the message names it.
    SpecError
        If a setting is none of a source or of the block.
    """
    import numpy as np

    from aatri.formats.parts.assembled import assembled
    from aatri.formats.parts.block_parts import LOCAL
    from aatri.formats.registry.settings import of_block
    from aatri.formats.registry.sources import read_all

    sources, parts = read_all(paths, settings, NARRATED, without=without)
    networks = [p for p in parts if is_network(p)]
    joins = 0 < len(networks) < len(parts)  # a network and the images that show its points
    if joins:
        check_merged(sources, parts, settings)
    single_stage = (len(sources) == 1 or joins) and bool(sources[0].format.stage)
    stated = {s.key: s.value for s in settings} if single_stage else of_block(settings)
    if not parts:
        return pipeline_text(sources, folder, with_options(OF_STRIPS, []), stated=stated)
    for of_source in parts:
        narrate(f"  {of_source.format}: {', '.join(counted(of_source)) or 'nothing of a block'}")
        for note in of_source.notes:
            narrate(f"    {note}")
    grids = _say_grids(paths, sources, parts)
    if single_stage and networks and not joins:
        has_control = bool(np.isin(parts[0].ground_points.get("role", 0), CONTROL).any())
        return pipeline_text(sources, folder, _of_network(has_control), stated=stated)
    not_stated = _not_stated({} if single_stage else stated)
    quiet = [replace(p, notes=[], others={} if joins and not p.images else p.others) for p in parts]
    block = assembled(quiet, not_stated, reporter=NARRATED)
    lacking = _lacking(block)
    narrate(f"block {block.name}: " + amounts(block.metrics()))
    if lacking:
        narrate(f"missing: {', '.join(lacking)}")
    if not _has_datum(block) and any(p.frame == LOCAL for p in parts if p.exterior):
        narrate("a free model: nothing gives its scale, so that m and mm of the results are units of the model")
    _check_enough(block, str(paths[0]))
    measured = single_stage and sources[0].format.name == "tables" and "photo" not in block.cameras.image_coordinates
    stages = _stages(block, _options(block, sources, parts), measured=measured)
    if len(block.fiducial_points):  # film on a comparator
        stages = stages.replace("interior_orientation/calibrated", "interior_orientation/affine")
    observed = (block.exterior.position_use == OBSERVED_VALUE).any()
    positions = len(block.exterior) and any("positions" in s.format.carries for s in sources)
    hint = ""
    if positions and not observed:
        hint = MAY_BE_OBSERVED
        file, of_positions = next((s.path.name, p) for s, p in zip(sources, parts) if p.exterior)
        angles = " --set attitude_sigma_deg=0.01" if _has_angles(of_positions) else ""
        remedy = f"--set {file}:use=observed --set position_sigma=[0.1,0.1,0.1]{angles}"
        narrate(f"positions are start values: no file says that they were measured; if they were: {remedy}")
    if not single_stage:
        stated = {name: value for p in reversed(parts) for name, value in p.not_stated.items()} | stated
    if not _to_match(block):
        return pipeline_text(sources, folder, stages, hint + grids, stated=stated, merges=joins)
    return pipeline_text(sources, folder, of_matched(stages), hint + grids, stated=stated, name="photos")


def _not_stated(stated: Mapping[str, object]) -> NotStated:
    """The options of the block that are said."""
    from pydantic import ValidationError

    from aatri.formats.parts.format import Reading
    from aatri.formats.parts.not_stated import NotStated

    for key, value in stated.items():
        where = f"--set {key}={value}"
        if key not in NotStated.model_fields:
            names = list(dict.fromkeys([*Reading.model_fields, *NotStated.model_fields]))
            raise SpecError(
                f"no option {key!r}{did_you_mean(key, names)}", where=where, remedy=f"options are {', '.join(names)}"
            )
        try:
            NotStated.model_validate({key: value})
        except ValidationError as error:
            raise SpecError(str(error.errors()[0]["msg"]), where=where) from error
    return NotStated.model_validate(dict(stated))


def _say_grids(paths: Sequence[Path], sources: Sequence[SourceWithSettings], parts: Sequence[BlockParts]) -> str:
    """Tell the grids of a geoid that lie in the folders and that no source uses; a remark for the pipeline."""
    from aatri.formats.parts.geoid import is_geoid_grid

    used = {Path(str(s.value)).name for source in sources for s in source.settings if s.key == "geoid"}
    grids = [file for path in paths if path.is_dir() for file in sorted(path.iterdir()) if is_geoid_grid(file)]
    of_heights = [s for s, p in zip(sources, parts) if p.ground_points or p.exterior]
    remark = ""
    for grid in grids:
        if grid.name in used or not of_heights:
            continue
        narrate(f"{grid}: grid of a geoid, not used: no file says that its heights are above it")
        for source in of_heights:
            crs = "" if any(s.key == "crs" for s in source.settings) else " --set crs=EPSG:..."
            narrate(f"    if those of {source.path.name} are:{crs} --set {source.path.name}:geoid={grid.name}")
        remark += (
            f"      # heights above the geoid of {grid.name}: {{..., crs: ..., geoid: {grid.name}}} at their source\n"
        )
    return remark


def _check_enough(block: Block, where: str) -> None:
    """Refuse images that nothing orients: without image points, or with too few and no observed position."""
    import numpy as np

    if _to_match(block):
        return
    images, points = len(block.images), len(block.image_points)
    enough = np.bincount(block.image_points.image, minlength=images) >= MIN_POINTS
    oriented = enough.copy()
    oriented[block.exterior.image[block.exterior.position_use == OBSERVED_VALUE]] = True
    if not images or (points and oriented.sum() >= min(2, images)):
        return
    what = f"{several(images, 'image')}, but no image points"
    if points:
        what = (
            f"{several(points, 'image point')} in {several(images, 'image')}, {MIN_POINTS} and more "
            f"in {int(enough.sum())}"
        )
    remedy = "add the file with the image points (tracks.csv, marks, tie points) as a further --from"
    raise InputError(what, where=where, remedy=remedy)


def _to_match(block: Block) -> bool:
    """Whether tie points are to come from the photographs: all are there, and most have but control."""
    import numpy as np

    ties = ~block.points_given_as(CONTROL, CHECK)[block.image_points.point]
    count = np.bincount(block.image_points.image[ties], minlength=len(block.images))
    return bool(len(block.images) and (block.images.path != "").all() and np.median(count) < MIN_POINTS)


def counted(parts: BlockParts) -> list[str]:
    tables = ("cameras", "images", "image_points", "ground_points", "exterior")
    keys = ("id", "id", "image", "point", "image")
    words = (
        "camera",
        "image",
        "image point",
        "ground point",
        "orientation" if _has_angles(parts) else "position",
    )
    counts = [len(getattr(parts, table).get(key, ())) for table, key in zip(tables, keys)]
    frame = [f"frame {parts.frame.crs}"] if parts.frame is not None else []
    return [several(count, word) for count, word in zip(counts, words) if count] + frame


def _has_angles(parts: BlockParts) -> bool:
    """Whether attitudes are there; photographs have the column, and those of a plain camera no value in it."""
    import numpy as np

    return any(np.isfinite(parts.exterior[name]).any() for name in ANGLES & {*parts.exterior})


def _has_start(block: Block) -> bool:
    import numpy as np

    e = block.exterior
    full = np.isfinite(e.position_m).all(axis=1) & np.isfinite(e.angles_rad).all(axis=1)
    return len(np.unique(e.image[full])) == len(block.images)


def _has_datum(block: Block) -> bool:
    metrics = block.metrics()
    return max(int(metrics["control_points"] or 0), int(metrics["exterior_observations"] or 0)) >= MIN_CONTROL


def _lacking(block: Block) -> list[str]:
    """What a block may have and this one does not."""
    has = {
        "start values of all images": not len(block.images) or _has_start(block),
        "control or observed positions": _has_datum(block),
        "check points": bool(block.metrics()["check_points"]),
        "a coordinate system": block.frames.crs[0] != "local",
    }
    return [what for what, there in has.items() if not there]


def _options(block: Block, sources: Sequence[SourceWithSettings], parts: Sequence[BlockParts]) -> list[str]:
    """Options of a bundle by what the files do not know: cameras, and standard deviations of image points."""
    formats = {s.format.name: s.format for s in sources}
    cameras = [formats[p.format] for p in parts if p.cameras and p.format in formats]
    points = [formats[p.format] for p in parts if p.image_points and p.format in formats]
    # a camera of an image or two is not determined by them: it keeps what the program has estimated
    calibrated = any(f.estimates_cameras for f in cameras) and len(block.images) > 2 * len(block.cameras)
    assumed = any("standard deviations" not in f.carries for f in points)
    matched = ["blunders: robust_snooping"] * _to_match(block)
    return [CALIBRATED] * calibrated + [COMPONENTS] * (assumed and _has_datum(block)) + matched


def _stages(block: Block, options: list[str], *, measured: bool) -> str:
    """The stages after the block; `options` of its bundle; `measured`: block.yaml says what is to be corrected."""
    if not len(block.images):
        return _of_network(_has_datum(block))
    if _has_start(block):
        return with_options(WITH_START + ACCURACY, [*["datum: minimal"] * (not _has_datum(block)), *options])
    by_strips = (block.images.strip >= 0).all() and _has_datum(block)
    stages = OF_STRIPS if by_strips else OF_GRAPH
    stages = stages.replace(UNCORRECTED, "") if measured else stages
    return with_options(stages + ACCURACY, [*["datum: free"] * (not _has_datum(block)), *options])


def _of_network(has_datum: bool) -> str:
    return with_options(NETWORK + ACCURACY, [] if has_datum else ["datum: free, datum_over: marked"])
