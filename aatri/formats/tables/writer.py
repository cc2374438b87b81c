"""Writing of a block folder: Block -> block.yaml and CSV tables, such that reading gives the same content to the bit.

Units are those of the Block (m, mm, rad, s), numbers are written with the fewest digits that give them back (`repr`),
and every standard deviation stands in its row. Coordinates follow the axes of the first frame. Rows that were set
aside by screening are written as they were before, so that reading sets them aside again. Truth is not written.

A variance that is the square of no float has no exact form in the contract; the nearest is written. No reader of aatri
makes such values.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.adapters.imported import sight_name
from aatri.arrays import Float
from aatri.artifacts.block import (
    ANTENNA,
    APPROXIMATE,
    CHECK,
    CONTROL,
    NO_ROLE,
    OBSERVED_VALUE,
    Block,
)
from aatri.errors import ResourceError
from aatri.formats.tables.relative_control import FILE as RELATIVE_CONTROL
from aatri.formats.tables.relative_control import write_relative_control
from aatri.formats.tables.settings.writing import settings_text
from aatri.formats.text.csv_cells import shielded
from aatri.frames.axes import in_order_of
from aatri.progress import SILENT, Reporter

Cells = list[str]

_ROLE_NAMES = {CONTROL: "control", CHECK: "check", APPROXIMATE: "approximate", NO_ROLE: "ignore"}


def write_block(block: Block, folder: Path, reporter: Reporter = SILENT) -> None:
    """Write a block folder.

    Parameters
    ----------
    block : Block
    folder : Path
        Made if it is not there; files of these names in it are replaced.

    Raises
    ------
    ResourceError
        If the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "block.yaml").write_text(settings_text(block), encoding="utf-8", newline="\n")
        for name, columns in _tables(block).items():
            _write_csv(folder / name, columns)
        if len(block.relative_control):
            write_relative_control(block, folder / RELATIVE_CONTROL, _axis_names(block))
    except OSError as error:
        raise ResourceError(
            f"cannot write: {error}", where=str(folder), remedy="free space or choose a folder"
        ) from error
    reporter.log(f"wrote block {block.name} to {folder}")


def _tables(block: Block) -> dict[str, dict[str, Cells]]:
    """The tables that have rows (images and image points always), as cells."""
    tables = {"images.csv": _images(block), "image_points.csv": _image_points(block)}
    if not len(block.images):
        tables = {}
    for name, rows, columns in (
        ("fiducials.csv", block.fiducial_points, _fiducials),
        ("ground_points.csv", block.ground_points, _ground_points),
        ("exterior.csv", block.exterior, _exterior),
        ("geodetic.csv", block.geodetic, _geodetic),
    ):
        if len(rows):
            tables[name] = columns(block)
    if len(block.geodetic_covariances) or len(block.ground_point_covariances):
        tables["covariances.csv"] = _covariances(block)
    return tables


def _write_csv(path: Path, columns: Mapping[str, Cells]) -> None:
    """Write the columns that hold anything, and the first ones of the contract in any case."""
    kept = {name: cells for k, (name, cells) in enumerate(columns.items()) if k < 4 or any(cells)}
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(kept) + "\n")
        file.writelines(",".join(row) + "\n" for row in zip(*kept.values()))


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


def _images(block: Block) -> dict[str, Cells]:
    rows = block.images
    strip_ids = [*block.strips.id.tolist(), ""]
    return {
        "image": _text(rows.id),
        "camera": _text(block.cameras.id[rows.camera]),
        "strip": _text(strip_ids[k] for k in rows.strip.tolist()),
        "sequence": _numbers(rows.sequence),
        "time": _numbers(rows.time_s),
        "flight": _text(rows.flight),
        "session": _text(rows.session),
        "rig": _text(rows.rig),
        "member": _text(rows.member),
    }


def _image_points(block: Block) -> dict[str, Cells]:
    rows = block.image_points
    image, point = block.images.id[rows.image], block.points.id[rows.point]
    switched_off = set(np.flatnonzero(~rows.active).tolist())
    rejected = set(block.rejects.id[block.rejects.kind == "image_point"].tolist())
    switched_off = {k for k in switched_off if f"{image[k]}/{point[k]}" not in rejected}
    return {
        "image": _text(image),
        "point": _text(point),
        "x": _numbers(rows.xy[:, 0]),
        "y": _numbers(rows.xy[:, 1]),
        "sx": _numbers(rows.sigma_mm[:, 0]),
        "sy": _numbers(rows.sigma_mm[:, 1]),
        "group": _text(rows.group),
        "active": ["no" if k in switched_off else "" for k in range(len(rows))],
        "row_time": _numbers(rows.row_time_s),
    }


def _fiducials(block: Block) -> dict[str, Cells]:
    rows = block.fiducial_points
    return {
        "image": _text(block.images.id[rows.image]),
        "fiducial": _text(block.fiducials.id[rows.fiducial]),
        "x": _numbers(rows.xy[:, 0]),
        "y": _numbers(rows.xy[:, 1]),
        "sx": _numbers(rows.sigma_mm[:, 0]),
        "sy": _numbers(rows.sigma_mm[:, 1]),
    }


def _axes(block: Block) -> list[str]:
    return str(block.frames.axes[0]).split(",")


def _position(block: Block, xyz: Float, covariance: Float) -> dict[str, Cells]:
    """X ... sYZ in the axes of the first frame."""
    xyz, covariance = in_order_of(xyz, _axes(block)), in_order_of(covariance, _axes(block))
    columns = {name: _numbers(xyz[:, k]) for k, name in enumerate("XYZ")}
    columns |= {f"s{name}": _numbers(np.sqrt(covariance[:, k, k])) for k, name in enumerate("XYZ")}
    for name, i, j in (("sXY", 0, 1), ("sXZ", 0, 2), ("sYZ", 1, 2)):
        value = covariance[:, i, j]
        columns[name] = _numbers(np.where(value == 0, np.nan, value))
    return columns


def _ground_points(block: Block) -> dict[str, Cells]:
    rows = block.ground_points
    roles = in_order_of(rows.role.astype(float), _axes(block)).astype(int)
    role = [
        _ROLE_NAMES[r[0]] if len(set(r)) == 1 else " ".join(f"{a}:{_ROLE_NAMES[v]}" for a, v in zip("XYZ", r))
        for r in roles.tolist()
    ]
    return {
        "point": _text(block.points.id[rows.point]),
        **_position(block, rows.xyz_m, rows.covariance_m2),
        "role": role,
        "datum": ["yes" if d else "" for d in rows.datum.tolist()],
    }


def _exterior(block: Block) -> dict[str, Cells]:
    rows = block.exterior
    position, angles = rows.position_use == OBSERVED_VALUE, rows.angle_use == OBSERVED_VALUE
    covariance = np.where(position[:, None, None], rows.position_covariance_m2, np.nan)
    columns = {"image": _text(block.images.id[rows.image])}
    columns |= _position(block, rows.position_m, covariance)
    columns |= {f"a{k + 1}": _numbers(rows.angles_rad[:, k]) for k in range(3)}
    columns |= {f"s{k + 1}": _numbers(np.where(angles, rows.angle_sigma_rad[:, k], np.nan)) for k in range(3)}
    columns["use"] = ["" if o else "approximate" for o in (position | angles).tolist()]
    columns["refers_to"] = ["antenna" if r == ANTENNA else "" for r in rows.refers_to.tolist()]
    columns["drift_group"] = _text(rows.drift_group)
    return columns


def _geodetic(block: Block) -> dict[str, Cells]:
    rows = block.geodetic
    axis = {f"d{own}": f"d{table}" for own, table in _axis_names(block).items()}
    rejected = set(block.rejects.id[block.rejects.kind == "geodetic"].tolist())
    off = [not a and sight_name(rows, k) not in rejected for k, a in enumerate(rows.active.tolist())]
    return {
        "type": _text(axis.get(t, t) for t in rows.type.tolist()),
        "from": _text(rows.start),
        "to": _text(rows.end),
        "value": _numbers(rows.value),
        "sigma": _numbers(rows.sigma),
        "via": _text(rows.via),
        "from_kind": _text("" if k == "point" else k for k in rows.start_kind.tolist()),
        "to_kind": _text("" if k == "point" else k for k in rows.end_kind.tolist()),
        "set": _text(rows.set),
        "group": _text(rows.group),
        "h_from": _numbers(rows.start_height_m),
        "h_to": _numbers(rows.end_height_m),
        "active": ["no" if o else "" for o in off],
        "reduced": _text("" if r == "no" else r for r in rows.reduced.tolist()),
    }


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
