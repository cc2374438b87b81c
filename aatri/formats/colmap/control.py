"""Control points beside a COLMAP model: a ground_points.csv of the block folder, with the ids of the model's points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aatri.artifacts.block import GroundPoints, Points
from aatri.errors import InputError, raise_all
from aatri.formats.tables.ground import GROUND_POINTS, ground_point_tables
from aatri.formats.tables.settings.block import Settings
from aatri.formats.tables.source import Source, texts
from aatri.formats.text.text_file import missing
from aatri.ids import canonical, rows_of
from aatri.progress import SILENT, Reporter
from aatri.strict_yaml import loads


class Ground(NamedTuple):
    """Ground points and the ids of all points."""

    table: GroundPoints
    ids: list[str]


def with_control(
    start: GroundPoints, names: Sequence[str], paths: Sequence[Path], control: Path | None, reporter: Reporter = SILENT
) -> tuple[Ground, list[Path]]:
    """Ground points with the control of a file in place of the start values of its points, and all files.

    Parameters
    ----------
    start : GroundPoints
        Row k belongs to names[k].
    names : sequence of str
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
        ids = canonical(names)
        return Ground(_sorted(replace(start, point=rows_of(list(names), ids))), ids), list(paths)
    if not control.is_file():
        raise missing(control)
    settings = Settings.model_validate({"aatri_block": 1, "frames": {"local": {"axes": ["x", "y", "z"]}}})
    source = Source(control.parent, settings, loads("aatri_block: 1", str(control), InputError), reporter)
    table = source.table(control.name, GROUND_POINTS)
    raise_all(source.problems)
    assert table is not None
    ids = canonical([*names, *table.text["point"]])
    given = ground_point_tables(source, table, Points(id=texts(ids)), None).points
    raise_all(source.problems)
    given = replace(given, file=np.full(len(given), len(paths), np.int32))
    kept = replace(start, point=rows_of(list(names), ids))
    kept = kept.take(~np.isin(kept.point, given.point))
    columns = GroundPoints.__dataclass_fields__
    both = {name: np.concatenate([getattr(kept, name), getattr(given, name)]) for name in columns}
    return Ground(_sorted(GroundPoints(**both)), ids), [*paths, control]


def _sorted(table: GroundPoints) -> GroundPoints:
    return table.take(np.argsort(table.point, kind="stable"))
