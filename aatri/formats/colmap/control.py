"""Control points beside a COLMAP model: a ground_points.csv of the block folder, with the ids of the model's points."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aatri.artifacts.builder import Columns
from aatri.errors import InputError, raise_all
from aatri.formats.tables.columns import GROUND_POINTS
from aatri.formats.tables.ground import ground_point_columns
from aatri.formats.tables.settings.block import Settings
from aatri.formats.tables.source import Source
from aatri.formats.text.text_file import missing
from aatri.progress import SILENT, Reporter
from aatri.strict_yaml import loads


def with_control(
    start: Columns, paths: Sequence[Path], control: Path | None, reporter: Reporter = SILENT
) -> tuple[Columns, list[Path]]:
    """Columns of ground points with the control of a file in place of the start values of its points, and all files.

    Parameters
    ----------
    start : mapping of str to array
        `point` holds ids.
    paths : sequence of Path
        Files so far.
    control : Path, optional
        X, Y, Z in metres, right-handed, in the frame wanted; standard deviations in metres.

    Raises
    ------
    InputError
        If the file is missing or breaks its contract.
    """
    if control is None:
        return start, list(paths)
    if not control.is_file():
        raise missing(control)
    settings = Settings.model_validate({"aatri_block": 1, "frames": {"local": {"axes": ["x", "y", "z"]}}})
    source = Source(control.parent, settings, loads("aatri_block: 1", str(control), InputError), reporter)
    columns, _ = ground_point_columns(source, source.table(control.name, GROUND_POINTS))
    raise_all(source.problems)
    columns["file"] = np.full(len(columns["line"]), len(paths))
    columns_of = {name: np.asarray(columns[name]) for name in start}
    kept = ~np.isin(np.asarray(start["point"]), columns_of["point"])
    both = {name: np.concatenate([np.asarray(values)[kept], columns_of[name]]) for name, values in start.items()}
    return both, [*paths, control]
