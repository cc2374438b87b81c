"""A Block from the columns that a reader has: ids instead of rows, in any order; what is not stated has its default.

    block_of(
        name="demo", files=[path],
        cameras={"id": ["c"], "principal_distance_mm": [153.0]},
        images={"id": ["1", "2"], "camera": ["c", "c"]},
        image_points={"image": ["1", "2"], "point": ["A", "A"], "xy": [[1.0, 2.0], [3.0, 4.0]], "sigma_mm": ...},
    )

The columns are those of the tables (`artifacts.block`). `camera`, `strip`, `image` and `point` are ids, or numbers of
rows in the order in which the reader gives cameras, images and `points`. Rows get their canonical order here; strips
and points are those that are named. Unless more is said, the frame is Cartesian with axes x, y, z, and nothing is
known of an earth.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Int, Text
from aatri.artifacts.block import (
    Block,
    CameraParameters,
    Cameras,
    Exterior,
    Files,
    Frames,
    GroundPoints,
    ImagePoints,
    Images,
    Points,
    Strips,
)
from aatri.errors import InputError
from aatri.formats.tables.images import image_point_order
from aatri.formats.tables.source import texts
from aatri.ids import printable
from aatri.tables.schema import is_optional, tables_of

Columns = Mapping[str, npt.ArrayLike]

PLAIN: Mapping[str, Any] = {
    "rotation": "omega-phi-kappa", "earth_curvature": "ignore", "terrain_height_m": np.nan, "undulation_m": np.nan,
    "heading": "true",
}  # fmt: skip


def block_of(
    *, name: str, files: Sequence[Path], cameras: Columns, images: Columns, image_points: Columns,
    camera_parameters: Columns | None = None, points: Iterable[str] = (), ground_points: Columns | None = None,
    exterior: Columns | None = None, **others: Any,
) -> Block:  # fmt: skip
    """The Block of some columns.

    Parameters
    ----------
    name : str
    files : sequence of Path
        The columns `file` count in it.
    cameras, camera_parameters, images, image_points, ground_points, exterior : mapping of str to array
        Columns of these tables.
    points : iterable of str
        Ids that rows of `point` count in, and of points that nothing measures.
    others
        Attributes of the Block, and tables made already.

    Raises
    ------
    InputError
        If an id stands twice, or one that is named is nowhere given.
    """
    paths = [str(path) for path in files]
    camera_ids, image_ids = _Ids.of("camera", cameras, paths), _Ids.of("image", images, paths)
    ground_points = ground_points or {}
    local = list(points)
    named = [_texts_in(local), _texts_in(image_points.get("point", ())), _texts_in(ground_points.get("point", ()))]
    point_ids = _Ids("point", np.unique(np.concatenate(named)), _texts_in(local), paths)
    strip_ids = np.unique([text for text in _texts_in(images.get("strip", ())).tolist() if text]).astype(np.str_)
    tables: dict[str, Any] = {
        "frames": Frames(id=texts(["local"]), axes=texts(["x,y,z"]), crs=texts(["local"]), vertical=texts([""])),
        "strips": Strips(id=strip_ids if len(strip_ids) else texts([])),
        "points": Points(id=point_ids.sorted),
    }
    if cameras:
        tables["cameras"] = _sorted_by_id(Cameras.of(**cameras))
    if images:
        rows = _with_rows(images, camera=camera_ids) | _strip_rows(images, strip_ids)
        tables["images"] = _sorted_by_id(Images.of(**rows))
    if image_points:
        measured = ImagePoints.of(**_with_rows(image_points, image=image_ids, point=point_ids))
        tables["image_points"] = measured.take(image_point_order(measured))
    if camera_parameters:
        of_cameras = CameraParameters.of(**_with_rows(camera_parameters, camera=camera_ids))
        tables["camera_parameters"] = of_cameras.take(np.lexsort((of_cameras.name, of_cameras.camera)))
    if ground_points:
        ground = GroundPoints.of(**_with_rows(ground_points, point=point_ids))
        tables["ground_points"] = ground.take(np.argsort(ground.point, kind="stable"))
    if exterior:
        orientations = Exterior.of(**_with_rows(exterior, image=image_ids))
        tables["exterior"] = orientations.take(np.argsort(orientations.image, kind="stable"))
    empty = {key: kind.empty() for key, kind in tables_of(Block).items() if not is_optional(Block, key)}
    return Block(name=name, **{**PLAIN, **empty, "files": Files(path=texts(paths)), **tables, **others})


class _Ids:
    """Ids of one kind, in canonical order and in that of the reader."""

    def __init__(self, kind: str, in_order: Text, local: Text, paths: list[str]) -> None:
        self.kind, self.sorted, self._paths = kind, in_order, paths
        self._row_of_local = np.searchsorted(in_order, local).astype(np.int32)

    @classmethod
    def of(cls, kind: str, columns: Columns, paths: list[str]) -> _Ids:
        """Ids of the rows of a table, each once."""
        local = _texts_in(columns.get("id", ()))
        in_order, count = np.unique(local, return_counts=True)
        if len(in_order) < len(local):
            twice = str(in_order[count > 1][0])
            at = int(np.flatnonzero(local == twice)[-1])
            raise InputError(f"{kind} {printable(twice)} stands twice", where=_place(columns, at, paths),
                             remedy="remove one, or give it another name")  # fmt: skip
        return cls(kind, in_order, local, paths)

    def rows(self, values: npt.ArrayLike, columns: Columns) -> Int:
        """Rows in canonical order of some ids, or of rows in the order of the reader."""
        given = np.asarray(values)
        if given.dtype.kind in "iu":
            return np.asarray(self._row_of_local[given])
        given = _texts_in(given)
        rows = np.searchsorted(self.sorted, given)
        unknown = np.ones(len(given), bool)
        if len(self.sorted):
            unknown = self.sorted[np.minimum(rows, len(self.sorted) - 1)] != given
        if unknown.any():
            at = int(np.argmax(unknown))
            raise InputError(f"{self.kind} {printable(str(given[at]))} is named, but not given",
                             where=_place(columns, at, self._paths), remedy="give it, or mend the id")  # fmt: skip
        return rows.astype(np.int32)


def _texts_in(values: npt.ArrayLike) -> Text:
    """A text column; nothing of a column of numbers."""
    array = np.asarray(values)
    return array.astype(np.str_) if array.size and array.dtype.kind not in "iu" else texts([])


def _place(columns: Columns, row: int, paths: list[str]) -> str:
    file, line = (int(np.asarray(columns[key])[row]) if key in columns else -1 for key in ("file", "line"))
    path = paths[file] if 0 <= file < len(paths) else (paths[0] if len(paths) == 1 else "")
    return f"{path}:{line}" if path and line > 0 else path


def _with_rows(columns: Columns, **references: _Ids) -> dict[str, Any]:
    return {**columns, **{key: ids.rows(columns[key], columns) for key, ids in references.items()}}


def _strip_rows(images: Columns, strip_ids: Text) -> dict[str, Any]:
    if "strip" not in images:
        return {}
    given = _texts_in(images["strip"])
    return {"strip": np.where(given != "", np.searchsorted(strip_ids, given), -1).astype(np.int32)}


def _sorted_by_id(table: Any) -> Any:
    return table.take(np.argsort(table.id, kind="stable"))
