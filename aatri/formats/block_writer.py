"""Writing of a block folder: Block -> block.yaml and CSV tables, such that reading gives the same content to the bit.

Units are those of the Block (m, mm, rad, s), numbers are written with the fewest digits that give them back (`repr`),
and every standard deviation stands in its row. Coordinates follow the axes of the first frame. Rows that were set
aside by screening are written as they were before, so that reading sets them aside again. Truth is not written.

Two things have no exact form in the contract: a variance that is the square of no float, and a radial correction that
is 0.001 times no float. The nearest is written; no reader of aatri makes such values.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

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
from aatri.formats.block_geodetic import reject_name
from aatri.formats.block_yaml import VECTORS
from aatri.formats.relative_control import FILE as RELATIVE_CONTROL
from aatri.formats.relative_control import write_relative_control
from aatri.frames.axes import in_order_of
from aatri.progress import SILENT, Reporter

Float = npt.NDArray[np.float64]
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
        (folder / "block.yaml").write_text(_settings(block), encoding="utf-8", newline="\n")
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
    if not len(block.images) and len(block.geodetic):
        tables = {}
    for name, rows, columns in (
        ("fiducials.csv", block.fiducial_points, _fiducials),
        ("ground_points.csv", block.ground_points, _ground_points),
        ("exterior.csv", block.exterior, _exterior),
        ("geodetic.csv", block.geodetic, _geodetic),
        ("covariances.csv", block.geodetic_covariances, _covariances),
    ):
        if len(rows):
            tables[name] = columns(block)
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
    off = [not a and reject_name(rows, k) not in rejected for k, a in enumerate(rows.active.tolist())]
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
    rows = block.geodetic_covariances
    return {
        "table": ["geodetic"] * len(rows),
        "row_a": [str(k + 1) for k in rows.row_a.tolist()],
        "row_b": [str(k + 1) for k in rows.row_b.tolist()],
        "value": _numbers(rows.value),
    }


def _axis_names(block: Block) -> dict[str, str]:
    """What the tables call the right-handed axes X, Y, Z."""
    own = {"east": "X", "north": "Y", "up": "Z"}
    return {own.get(name, name.upper()): "XYZ"[k] for k, name in enumerate(_axes(block))}


def _settings(block: Block) -> str:
    """block.yaml; texts in the JSON form, which is YAML too."""
    frames = {
        str(f): {"axes": a.split(","), "crs": str(c)} | ({"vertical": str(v)} if v else {})
        for f, a, c, v in zip(block.frames.id, block.frames.axes.tolist(), block.frames.crs, block.frames.vertical)
    }
    units = {"ground": "m", "angle": "rad", "sigma_image": "mm", "sigma_ground": "m", "sigma_angle": "rad", "time": "s"}
    lines = ["aatri_block: 1", f"name: {_yaml(block.name)}", "frames:"]
    lines += [f"  {_yaml(name)}: {_yaml(frame)}" for name, frame in frames.items()]
    lines += [f"earth_curvature: {block.earth_curvature}", f"units: {_yaml(units)}", f"rotation: {block.rotation}"]
    if np.isfinite(block.terrain_height_m):
        lines.append(f"terrain_height: {_yaml(float(block.terrain_height_m))}")
    if len(block.cameras):
        lines.append("cameras:")
    for k, name in enumerate(block.cameras.id):
        lines.append(f"  {_yaml(str(name))}:")
        lines += [f"    {key}: {_yaml(value)}" for key, value in _camera(block, k).items()]
    return "\n".join(lines) + "\n"


def _camera(block: Block, k: int) -> dict[str, Any]:
    c = block.cameras
    found: dict[str, Any] = {"kind": str(c.kind[k]), "image_coordinates": str(c.image_coordinates[k])}
    if np.isfinite(c.pixel_size_mm[k]).all():
        pixel = {"size": c.pixel_size_mm[k].tolist()}
        pixel |= {key: str(v) for key, v in (("origin", c.pixel_origin[k]), ("y", c.pixel_y[k])) if v}
        found["pixel"] = pixel
    if np.isfinite(c.format[k]).all():
        found["format"] = c.format[k].tolist()
    found["principal_distance"] = float(c.principal_distance_mm[k])
    found["principal_point"] = c.principal_point_mm[k].tolist()
    found["symmetry_point"] = c.symmetry_point_mm[k].tolist()
    marks = block.fiducials.camera == k
    if marks.any():
        found["fiducials"] = dict(zip(block.fiducials.id[marks].tolist(), block.fiducials.xy_mm[marks].tolist()))
    found["distortion"], found["sigmas"] = _distortion(block, k), _sigmas(block, k)
    found["lever_arm"], found["boresight"] = c.lever_arm_m[k].tolist(), c.boresight_rad[k].tolist()
    return found


def _distortion(block: Block, k: int) -> dict[str, Any]:
    rows, table = block.camera_parameters, block.distortion_table
    found: dict[str, Any] = {"model": str(block.cameras.distortion[k])}
    given = (rows.camera == k) & np.isfinite(rows.value)
    found |= dict(zip(rows.name[given].tolist(), rows.value[given].tolist()))
    mine = table.camera == k
    if mine.any():
        found["radius"] = table.radius_mm[mine].tolist()
        found["correction"] = [_thousandfold(mm) for mm in table.correction_mm[mine].tolist()]
    return found


def _thousandfold(value: float) -> float:
    """The number that gives `value` when multiplied by 0.001, if there is one; else the nearest."""
    near = value * 1e3
    tried = [near, math.nextafter(near, math.inf), math.nextafter(near, -math.inf)]
    return min(tried, key=lambda v: abs(v * 1e-3 - value))


def _sigmas(block: Block, k: int) -> dict[str, Any]:
    """Standard deviations by parameter; components of a vector together."""
    rows = block.camera_parameters
    mine = (rows.camera == k) & (rows.free | np.isfinite(rows.sigma))
    single = {n: math.inf if f else s for n, s, f in
              zip(rows.name[mine].tolist(), rows.sigma[mine].tolist(), rows.free[mine].tolist())}  # fmt: skip
    found: dict[str, Any] = {}
    for name, sigma in single.items():
        vector, dot, _ = name.partition(".")
        if dot:
            found[vector] = [single.get(f"{vector}.{axis}", 0.0) for axis in VECTORS[vector]]
        else:
            found[name] = sigma
    return found


def _yaml(value: Any) -> str:
    """A value in flow style; infinity as YAML writes it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_yaml(str(key))}: {_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_yaml, value)) + "]"
    if isinstance(value, float) and math.isinf(value):
        return ".inf"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)
