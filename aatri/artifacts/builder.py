"""A Block from the columns that a reader has: ids instead of rows, in any order; what is not stated has its default.

    block_of(
        name="demo", files=[path],
        cameras={"id": "c", "principal_distance_mm": 153.0},
        images={"id": ["1", "2"], "camera": "c"},
        image_points={"image": ["1", "2"], "point": ["A", "A"], "xy": [[1.0, 2.0], [3.0, 4.0]], "sigma_mm": 0.005},
        ground_points={"point": ["A"], "xyz_m": [[1.0, 2.0, 3.0]], "sigma_m": 0.01, "role": CONTROL},
    )

The columns are those of the tables (`artifacts.block`); one value stands for all rows. Instead of `file` and `line`,
`at` are the places where rows were read; `sigma_m` stands for a covariance without correlations. `camera`, `strip`,
`image` and `point` are ids, or numbers of rows in the order in which the reader gives cameras, images and `points`;
covariances count in its rows too. Rows get their canonical order here; strips and points are those that are named.
Unless more is said, the frame is Cartesian with axes x, y, z, and nothing is known of an earth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import (
    Block,
    CameraParameters,
    Cameras,
    Exterior,
    FiducialPoints,
    Files,
    Frames,
    Geodetic,
    GeodeticCovariances,
    GroundPointCovariances,
    GroundPoints,
    Images,
    MeasuredPoints,
    ModelCoordinates,
    Points,
    StripIds,
)
from aatri.errors import InputError
from aatri.ids import printable
from aatri.tables.schema import Table, columns_of, may_be_absent, tables_of

Columns = Mapping[str, Any]
"""Columns of a table by name."""

PLAIN: Mapping[str, Any] = {
    "rotation": "omega-phi-kappa",
    "earth_curvature": "ignore",
    "terrain_height_m": np.nan,
    "undulation_m": np.nan,
    "heading": "true",
}


def block_of(
    *,
    name: str,
    files: Sequence[Path | str] = (),
    cameras: Columns | Table | None = None,
    camera_parameters: Columns | Table | None = None,
    images: Columns | None = None,
    image_points: Columns | None = None,
    points: Iterable[str] = (),
    ground_points: Columns | None = None,
    ground_point_covariances: Columns | None = None,
    exterior: Columns | None = None,
    geodetic: Columns | None = None,
    geodetic_covariances: Columns | None = None,
    fiducial_points: Columns | None = None,
    model_coordinates: Columns | None = None,
    **others: Any,
) -> Block:
    """The Block of some columns.

    Parameters
    ----------
    files : sequence of Path
        The columns `file` count in it.
    cameras ... model_coordinates : mapping of str to array
        Columns of these tables; cameras may be tables.
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
    stated = {
        "cameras": cameras,
        "camera_parameters": camera_parameters,
        "images": images,
        "image_points": image_points,
        "ground_points": ground_points,
        "exterior": exterior,
        "geodetic": geodetic,
        "fiducial_points": fiducial_points,
        "model_coordinates": model_coordinates,
    }
    columns = {key: _plain_columns(of_table, paths) for key, of_table in stated.items()}
    local = _texts_in(list(points))
    named = [_texts_in(columns[key].get("point", ())) for key in ("image_points", "ground_points", "model_coordinates")]
    ids = {
        "camera": _Ids.of("camera", columns["cameras"], paths),
        "image": _Ids.of("image", columns["images"], paths),
        "point": _Ids("point", np.unique(np.concatenate([*named, local])), local, paths),
    }
    strip_ids = np.unique([text for text in _texts_in(columns["images"].get("strip", ())) if text]).astype(np.str_)
    columns["images"] |= _strip_rows(columns["images"], strip_ids)
    tables: dict[str, Any] = {
        "frames": Frames(
            id=_texts_in(["local"]), axes=_texts_in(["x,y,z"]), crs=_texts_in(["local"]), vertical=_texts_in([""])
        ),
        "strips": StripIds(id=_texts_in(strip_ids)),
        "points": Points(id=ids["point"].sorted),
    }
    orders = dict[str, Int]()
    for key, (table, references, order_of) in _TABLES.items():
        if columns[key]:
            rows = table.of(**_with_rows(columns[key], **{name: ids[name] for name in references}))
            orders[key] = order_of(rows)
            tables[key] = rows.take(orders[key])
    if ground_points and ground_point_covariances:
        tables["ground_point_covariances"] = _between_points(ground_point_covariances, orders["ground_points"])
    if geodetic and geodetic_covariances:
        a, b, value = _pairs(geodetic_covariances, orders["geodetic"], 1)
        tables["geodetic_covariances"] = GeodeticCovariances(row_a=a, row_b=b, value=value)
    empty = {key: kind.empty() for key, kind in tables_of(Block).items() if not may_be_absent(Block, key)}
    return Block(name=name, **{**PLAIN, **empty, "files": Files(path=_texts_in(paths)), **tables, **others})


def _by(*names: str) -> Callable[[Any], Int]:
    """The order of rows by some of their columns, the first one foremost."""
    return lambda rows: np.lexsort([getattr(rows, name) for name in reversed(names)])


def image_point_order(rows: MeasuredPoints) -> Int:
    """The canonical order: by image, point, x, y, then whatever may still differ."""
    order = np.lexsort((rows.xy[:, 1], rows.xy[:, 0], rows.point, rows.image))
    same = (np.diff(rows.image[order]) == 0) & (np.diff(rows.point[order]) == 0)
    if not same.any():
        return order
    return np.lexsort(
        (
            rows.row_time_s,
            rows.active,
            rows.group,
            rows.sigma_mm[:, 1],
            rows.sigma_mm[:, 0],
            rows.xy[:, 1],
            rows.xy[:, 0],
            rows.point,
            rows.image,
        )
    )


def geodetic_order(rows: Geodetic) -> Int:
    """The canonical order: by type, set, via, start, end, and the figures."""
    names = ("type", "set", "via", "start", "end", "start_kind", "end_kind", "group", "reduced")
    figures = ("value", "sigma", "start_height_m", "end_height_m")
    columns = [getattr(rows, name).tolist() for name in names]
    columns += [np.nan_to_num(getattr(rows, name), nan=-1.0).tolist() for name in figures]
    keys = list(zip(*columns))
    return np.array(sorted(range(len(rows)), key=lambda k: keys[k]), dtype=np.intp)


_TABLES: Mapping[str, tuple[type[Table], tuple[str, ...], Callable[[Any], Int]]] = {
    "cameras": (Cameras, (), _by("id")),
    "camera_parameters": (CameraParameters, ("camera",), _by("camera", "name")),
    "images": (Images, ("camera",), _by("id")),
    "image_points": (MeasuredPoints, ("image", "point"), image_point_order),
    "ground_points": (GroundPoints, ("point",), _by("point")),
    "exterior": (Exterior, ("image",), _by("image")),
    "geodetic": (Geodetic, (), geodetic_order),
    "fiducial_points": (FiducialPoints, ("image",), _by("image", "fiducial")),
    "model_coordinates": (ModelCoordinates, ("point",), _by("model", "point")),
}
"""Of each table of columns: its class, its columns of ids, and its canonical order."""


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
            raise InputError(
                f"{kind} {printable(twice)} stands twice",
                where=_place(columns, at, paths),
                remedy="remove one, or give it another name",
            )
        return cls(kind, in_order, local, paths)

    def rows(self, values: npt.ArrayLike, columns: Columns) -> Int:
        """Rows in canonical order of some ids, or of rows in the order of the reader."""
        named = np.asarray(values)
        if named.dtype.kind in "iu":
            return np.asarray(self._row_of_local[named])
        ids = _texts_in(named)
        rows = np.searchsorted(self.sorted, ids)
        unknown = np.ones(len(ids), bool)
        if len(self.sorted):
            unknown = self.sorted[np.minimum(rows, len(self.sorted) - 1)] != ids
        if unknown.any():
            at = int(np.argmax(unknown))
            raise InputError(
                f"{self.kind} {printable(str(ids[at]))} is named, but not given",
                where=_place(columns, at, self._paths),
                remedy="give it, or mend the id",
            )
        return np.asarray(rows.astype(np.int32) if named.ndim else rows[0])


def _texts_in(values: npt.ArrayLike) -> Text:
    """A text column; nothing of a column of numbers."""
    array = np.atleast_1d(np.asarray(values))
    return array.astype(np.str_) if array.size and array.dtype.kind not in "iu" else np.zeros(0, "U1")


def _plain_columns(columns: Columns | Table | None, paths: list[str]) -> dict[str, Any]:
    """The columns with those of the table in the place of `at` and `sigma_m`; lines alone are of the one file."""
    if isinstance(columns, Table):
        return {name: getattr(columns, name) for name in columns_of(type(columns))}
    plain: dict[str, Any] = dict(columns or {})
    if "at" in plain:
        places = plain.pop("at")
        file = {path: k for k, path in enumerate(paths)}
        plain |= {"file": [file[str(place.path)] for place in places], "line": [place.line for place in places]}
    elif "line" in plain:
        plain.setdefault("file", 0)
    if "sigma_m" in plain:
        variance = np.asarray(plain.pop("sigma_m"), dtype=np.float64) ** 2
        name = "covariance_m2" if "xyz_m" in plain else "position_covariance_m2"
        plain[name] = variance[..., None] * np.eye(3)
    return plain


def _place(columns: Columns, row: int, paths: list[str]) -> str:
    file, line = (int(np.resize(columns.get(key, -1), row + 1)[row]) for key in ("file", "line"))
    path = paths[file] if 0 <= file < len(paths) else (paths[0] if len(paths) == 1 else "")
    return f"{path}:{line}" if path and line > 0 else path


def _with_rows(columns: Columns, **references: _Ids) -> dict[str, Any]:
    return {**columns, **{key: ids.rows(columns[key], columns) for key, ids in references.items()}}


def _strip_rows(images: Columns, strip_ids: Text) -> dict[str, Any]:
    if "strip" not in images:
        return {}
    strips = _texts_in(images["strip"])
    rows = np.where(strips != "", np.searchsorted(strip_ids, strips), -1)
    return {"strip": rows if np.ndim(images["strip"]) else rows[0]}


def _between_points(columns: Columns, order: Int) -> GroundPointCovariances:
    a, b, value = _pairs(columns, order, 3)
    return GroundPointCovariances(row_a=a // 3, axis_a=a % 3, row_b=b // 3, axis_b=b % 3, value=value)


def _pairs(columns: Columns, order: Int, per_row: int) -> tuple[Int, Int, Float]:
    """Places of each pair in canonical order, the smaller one first, and its value."""
    place = np.argsort(order)
    ends = [
        per_row * place[np.asarray(columns[f"row_{side}"], dtype=np.intp)]
        + np.asarray(columns.get(f"axis_{side}", 0), dtype=np.intp)
        for side in "ab"
    ]
    a, b = np.sort(np.stack(ends), axis=0)
    sorted_ = np.lexsort((b, a))
    return a[sorted_], b[sorted_], np.asarray(columns["value"], dtype=np.float64)[sorted_]
