"""Writing of a block folder: Block -> block.yaml and CSV tables, such that reading gives the same content to the bit.

Units are those of the Block (m, mm, rad, s), numbers are written with the fewest digits that give them back (`repr`),
and every standard deviation stands in its row. Coordinates follow the axes of the first frame. Rows that were set
aside by screening are written as they were before, so that reading sets them aside again. Truth is not written.

A variance that is the square of no float has no exact form in the contract; the nearest is written. No reader of aatri
makes such values.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.artifacts.block import OBSERVED_VALUE, Block
from aatri.formats.tables.columns import COVARIANCES, TABLES, Stated
from aatri.formats.tables.ground import ROLES
from aatri.formats.tables.relative_control import FILE as RELATIVE_CONTROL
from aatri.formats.tables.relative_control import relative_control_text
from aatri.formats.tables.settings.reading import settings_text
from aatri.formats.text.csv_cells import shielded
from aatri.formats.text.written_files import write_files
from aatri.frames.axes import in_order_of
from aatri.tables.schema import Table, columns_of

Cells = list[str]

_ROLE_NAMES = {code: word for word, code in ROLES.items()}


def write_block(block: Block, folder: Path) -> None:
    """Write a block folder.

    Parameters
    ----------
    folder : Path
        Made if it is not there; files of these names in it are replaced.

    Raises
    ------
    ResourceError
        If the folder cannot be written.
    """
    texts = {"block.yaml": settings_text(block)}
    texts |= {name: _csv_text(columns) for name, columns in _tables(block, folder).items()}
    if len(block.relative_control):
        texts[RELATIVE_CONTROL] = relative_control_text(block, _axis_names(block))
    write_files(folder, texts)


def _tables(block: Block, folder: Path) -> dict[str, dict[str, Cells]]:
    """The tables that have rows (images and image points always), as cells."""
    made = {
        "images.csv": (block.images, _of_images(block, folder)),
        "image_points.csv": (block.image_points, _of_image_points(block)),
        "fiducials.csv": (block.fiducial_points, {}),
        "ground_points.csv": (block.ground_points, _of_ground_points(block)),
        "exterior.csv": (block.exterior, _of_exterior(block)),
        "geodetic.csv": (block.geodetic, _of_geodetic(block)),
    }
    always = ("images.csv", "image_points.csv") if len(block.images) else ()
    tables = {
        name: _cells(block, rows, TABLES[name], own)
        for name, (rows, own) in made.items()
        if len(rows) or name in always
    }
    if len(block.geodetic_covariances) or len(block.ground_point_covariances):
        tables["covariances.csv"] = _covariances(block)
    return tables


def _cells(block: Block, rows: Table, columns: Mapping[str, Stated], own: Mapping[str, Cells]) -> dict[str, Cells]:
    """Cells of a table: its own where they are more than a value, and those of the Block's columns."""
    return {
        name: own[name] if name in own else _values(block, rows, stated)
        for name, stated in columns.items()
        if stated.field or name in own
    }


def _values(block: Block, rows: Table, stated: Stated) -> Cells:
    declared, values = columns_of(type(rows))[stated.field], getattr(rows, stated.field)
    if stated.part is not None:
        values = values[:, stated.part]
    if declared.refers:
        return _text([*getattr(block, declared.refers).id.tolist(), ""][row] for row in values.tolist())
    if stated.words:
        words = {value: word for word, value in stated.words.items()}
        first = next(iter(stated.words))
        return ["" if words[value] == first else words[value] for value in values.tolist()]
    if stated.empty is not None:
        return ["" if value == stated.empty else "yes" if value else "no" for value in values.tolist()]
    return _numbers(values) if declared.dtype == "f8" else _text(values)


def _csv_text(columns: Mapping[str, Cells]) -> str:
    """The columns that hold anything, and the first ones of the contract in any case."""
    kept = {name: cells for k, (name, cells) in enumerate(columns.items()) if k < 4 or any(cells)}
    return "".join(",".join(row) + "\n" for row in (kept, *zip(*kept.values())))


def _numbers(values: npt.NDArray[Any]) -> Cells:
    """Shortest decimals that give the values back; empty for NaN."""
    return ["" if v != v else repr(v) for v in values.tolist()]


def _text(values: Iterable[Any]) -> Cells:
    """Texts, in quotes where CSV needs them and where a row could be taken for a comment."""
    made: dict[str, str] = {}
    return [made.get(v) or made.setdefault(v, _quoted(v)) for v in map(str, values)]


def _quoted(text: str) -> str:
    text = shielded(text)
    if text.startswith("#") or any(sign in text for sign in ',"'):
        return '"' + text.replace('"', '""') + '"'
    return text


def _of_images(block: Block, folder: Path) -> dict[str, Cells]:
    """Photographs and masks below the folder by their way from there, others by their whole path."""
    top = folder.resolve()
    files = {
        name: [Path(path).resolve() if path else None for path in getattr(block.images, name).tolist()]
        for name in ("path", "mask")
    }
    return {
        name: _text("" if p is None else p.relative_to(top) if p.is_relative_to(top) else p for p in paths)
        for name, paths in files.items()
    }


def _of_image_points(block: Block) -> dict[str, Cells]:
    rows, rejected = block.image_points, _rejected(block, "image_point")
    ids = zip(block.images.id[rows.image].tolist(), block.points.id[rows.point].tolist(), rows.active.tolist())
    return {"active": ["" if used or f"{image}/{point}" in rejected else "no" for image, point, used in ids]}


def _rejected(block: Block, kind: str) -> set[str]:
    """What was set aside of a kind, and will be again."""
    return set(block.rejects.id[block.rejects.kind == kind].tolist())


def _axes(block: Block) -> list[str]:
    return str(block.frames.axes[0]).split(",")


def _position(block: Block, xyz: Float, covariance: Float) -> dict[str, Cells]:
    """X ... sYZ in the axes of the first frame."""
    xyz, covariance = in_order_of(xyz, _axes(block)), in_order_of(covariance, _axes(block))
    columns = {name: _numbers(xyz[:, k]) for k, name in enumerate("XYZ")}
    columns |= {f"s{name}": _numbers(np.sqrt(covariance[:, k, k])) for k, name in enumerate("XYZ")}
    for name, (i, j) in COVARIANCES.items():
        value = covariance[:, i, j]
        columns[name] = _numbers(np.where(value == 0, np.nan, value))
    return columns


def _of_ground_points(block: Block) -> dict[str, Cells]:
    rows = block.ground_points
    roles = in_order_of(rows.role.astype(float), _axes(block)).astype(int)
    role = [
        _ROLE_NAMES[r[0]] if len(set(r)) == 1 else " ".join(f"{a}:{_ROLE_NAMES[v]}" for a, v in zip("XYZ", r))
        for r in roles.tolist()
    ]
    return {**_position(block, rows.xyz_m, rows.covariance_m2), "role": role}


def _of_exterior(block: Block) -> dict[str, Cells]:
    rows = block.exterior
    position, angles = rows.position_use == OBSERVED_VALUE, rows.angle_use == OBSERVED_VALUE
    sigma = np.where(angles[:, None], rows.angle_sigma_rad, np.nan)
    return {
        **_position(block, rows.position_m, np.where(position[:, None, None], rows.position_covariance_m2, np.nan)),
        **{f"s{k + 1}": _numbers(sigma[:, k]) for k in range(3)},
        "use": ["" if observed else "approximate" for observed in (position | angles).tolist()],
    }


def _of_geodetic(block: Block) -> dict[str, Cells]:
    rows, rejected = block.geodetic, _rejected(block, "geodetic")
    axis = {f"d{own}": f"d{table}" for own, table in _axis_names(block).items()}
    used = [a or rows.called(k) in rejected for k, a in enumerate(rows.active.tolist())]
    return {"type": _text(axis.get(t, t) for t in rows.type.tolist()), "active": ["" if u else "no" for u in used]}


def _covariances(block: Block) -> dict[str, Cells]:
    rows, ground = block.geodetic_covariances, block.ground_point_covariances
    point, axis = block.points.id[block.ground_points.point], list(_axis_names(block).values())
    return {
        "table": ["geodetic"] * len(rows) + ["ground_points"] * len(ground),
        "row_a": [str(k + 1) for k in rows.row_a.tolist()] + _text(point[ground.row_a]),
        "row_b": [str(k + 1) for k in rows.row_b.tolist()] + _text(point[ground.row_b]),
        "value": _numbers(rows.value) + _numbers(ground.value),
        "coord_a": [""] * len(rows) + [axis[k] for k in ground.axis_a.tolist()],
        "coord_b": [""] * len(rows) + [axis[k] for k in ground.axis_b.tolist()],
    }


def _axis_names(block: Block) -> dict[str, str]:
    """What the tables call the right-handed axes X, Y, Z, in this order."""
    own = {"east": "X", "north": "Y", "up": "Z"}
    named = {own.get(name, name.upper()): "XYZ"[k] for k, name in enumerate(_axes(block))}
    return {axis: named[axis] for axis in "XYZ"}
