"""Pipelines that `aatri new` writes, as text: the line that reads the block with what is said of it, the stages."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aatri.formats.registry.settings import SourceWithSettings

REMARKS = {"control_sigma": "     # m, of control without a standard deviation; 0 is exact"}
"""What stands beside an option of the block."""

HEAD = "run: runs/block\nseed: 1\nstages:\n"
INTERIOR = "  interior: {use: interior_orientation/calibrated, from: {block}}\n"
UNCORRECTED = ",\n             with: {refraction: false, earth_curvature: false}"
"""Where image coordinates of other programs are corrected already, or nobody knows."""
REFINED = f"""\
  refined:  {{use: image_refinement/systematic, from: {{block, image_points: interior}}{UNCORRECTED}}}
"""
ACCURACY = "  accuracy: {use: accuracy/evaluation, from: {block, solution: bundle}}\n"
MATCHED = "  block:    {use: tie_points/sift, from: {block: photos}}\n"
"""Tie points of photographs, which stand before it."""
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


BY_HAND = """\
# Messages may name block.yaml and its tables: `aatri export RUN:block tables FOLDER` writes those of this block, to be
# changed by hand; `aatri new --from FOLDER` goes on with them.
"""


def pipeline_text(
    sources: Sequence[SourceWithSettings],
    folder: Path,
    stages: str,
    remarks: str = "",
    *,
    stated: Mapping[str, object],
    name: str = "block",
    merges: bool = False,
) -> str:
    """The pipeline with the stage `name` that reads the block, what is said of it and of each source, and remarks.

    `merges`: the sources are blocks, which `block/merged` puts together.
    """
    if len(sources) == 1 and sources[0].format.stage:
        options = {"path": path_from(sources[0].path, folder)} | dict(stated) | _files_of(sources[0], folder)
        block = f"  {name + ':':9} {{use: {sources[0].format.stage}, with: {_mapping(options)}}}\n"
    elif merges:
        of_each = [{k: v for k, v in _of_source(s, folder).items() if k != "format"} for s in sources]
        blocks = ", ".join(_mapping(each) if len(each) > 1 else json.dumps(each["path"]) for each in of_each)
        block = f"  {name + ':':9} {{use: block/merged, with: {{blocks: [{blocks}]}}}}\n"
    else:
        lines = "".join(f"        - {_mapping(_of_source(s, folder))}   # {s.format.title}\n" for s in sources)
        taken = {"image_sigma_px": 1.0, "control_sigma": [0.0, 0.0, 0.0]} | dict(stated)
        options_of_block = "".join(
            f"      {key}: {_value(value)}{REMARKS.get(key, '')}\n" for key, value in taken.items()
        )
        block = (
            f"  {name}:\n    use: block/combined\n    with:\n"
            "      # what no file says, with the values taken: aatri stages block/combined lists all options\n"
            f"{options_of_block}{remarks}"
            "      sources:                           # the first with images says which there are\n" + lines
        )
    count = f"{len(sources)} source{'s' * (len(sources) != 1)}"
    by_hand = "" if [one.format.name for one in sources] == ["tables"] else BY_HAND
    return f"# Written by aatri new --from; {count}.\n{by_hand}{HEAD}{block}{stages}"


def _of_source(source: SourceWithSettings, folder: Path) -> dict[str, object]:
    """What the pipeline says of a source: what is said of it alone comes last."""
    options: dict[str, object] = {"path": path_from(source.path, folder), "format": source.format.name}
    for setting in sorted(source.settings, key=lambda s: bool(s.source)):
        options[setting.key] = setting.value
    return options | _files_of(source, folder)


def _files_of(source: SourceWithSettings, folder: Path) -> dict[str, object]:
    """Options of a source that name a file."""
    from aatri.formats.registry.settings import OF_FILES

    files = {key: getattr(source.reading(), key) for key in OF_FILES}
    return {key: path_from(path, folder) for key, path in files.items() if path is not None}


def _mapping(options: Mapping[str, object]) -> str:
    """Options as a mapping of YAML in one line."""
    return f"{{{', '.join(f'{key}: {_value(value)}' for key, value in options.items())}}}"


def _value(value: object) -> str:
    """A value of YAML: a text in quotation marks where it is more than a word."""
    plain = isinstance(value, str) and re.fullmatch(r"[a-z][a-z_]*", value) and value not in ("yes", "no", "null")
    return str(value) if plain else json.dumps(value, ensure_ascii=False)


def path_from(path: Path, folder: Path) -> str:
    """The path as the pipeline names it: relative to its folder."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def with_options(stages: str, options: Sequence[str]) -> str:
    """The stages, the bundle with its options."""
    return stages.replace("{with}", f", with: {{{', '.join(options)}}}" if options else "")


def of_matched(stages: str) -> str:
    """The stages of photographs, the stage `photos`, whose tie points are found in their pixels; nothing is refined."""
    return MATCHED + stages.replace(REFINED, "").replace("image_points: refined", "image_points: interior")


SEARCHED_GRAPH = with_options(OF_GRAPH + ACCURACY, ["blunders: robust_snooping"])
"""Orientation along the graph, its bundle with a search for gross errors."""
PHOTOS = f"""\
# Photographs: images, cameras and positions are what their files say, tie points are found in their pixels.
# Without positions the bundle has `datum: free`. Control measured elsewhere: `aatri new --from PHOTOGRAPHS --from
# LIST`; to measure control: `aatri export RUN:block tables FOLDER`, then `aatri measure FOLDER`.
{HEAD}  photos:   {{use: block/photos, with: {{path: @PATH@}}}}
{of_matched(SEARCHED_GRAPH)}"""
