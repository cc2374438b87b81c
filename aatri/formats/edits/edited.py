"""A block with edits applied, one after the other; what they no longer fit is refused by name."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Int, Text
from aatri.artifacts.block import APPROXIMATE_VALUE, BY_EDIT, NO_ROLE, Block, Files, Rejects
from aatri.artifacts.builder import image_point_order
from aatri.errors import Faults, raise_all
from aatri.formats.edits.edit import BY_COORDINATE, Edit, read_edits
from aatri.formats.limits import SAME_PRINTED
from aatri.ids import clipped, did_you_mean, several
from aatri.progress import Reporter

REMEDY = "the block has changed since the edit was made: delete the line, or run `aatri edit` again"


def edited(block: Block, path: Path | None, reporter: Reporter) -> Block:
    """The block with the edits of a file; as it is without one.

    Raises
    ------
    InputError
        If the file cannot be read, or an edit names nothing of the block, or an observation that has another value.
    """
    if path is None:
        return block
    edits = read_edits(path)
    block = with_edits(block, edits)
    reporter.log(f"{path}: {several(len(edits), 'edit')}: {', '.join(map(str, edits[:5]))}{' ...' * (len(edits) > 5)}")
    return replace(block, files=Files(path=np.append(block.files.path, str(path))))


def with_edits(block: Block, edits: tuple[Edit, ...]) -> Block:
    """The block with edits.

    Raises
    ------
    InputError
        If one names nothing of the block, or an observation that has another value.
    """
    faults = Faults()
    for edit in edits:
        rows = _rows(block, edit, edit.ids, faults)
        if rows is not None:
            block = _DO[edit.do](block, edit, rows, faults)
    raise_all(faults)
    return block


_TABLES = {
    "image_point": "image_points",
    "fiducial": "fiducial_points",
    "control": "ground_points",
    "position": "exterior",
    "attitude": "exterior",
    "geodetic": "geodetic",
}


def measured_value(block: Block, family: str, row: int) -> tuple[float, ...]:
    """What was measured, as `value` of an edit has it; NaN is left out."""
    columns = {
        "image_point": block.image_points.xy,
        "fiducial": block.fiducial_points.xy,
        "control": block.ground_points.xyz_m,
        "position": block.exterior.position_m,
        "attitude": block.exterior.angles_rad,
        "geodetic": block.geodetic.value[:, None],
    }
    value = columns[family][row]
    return tuple(float(v) for v in value[np.isfinite(value)])


def _names(block: Block, edit: Edit) -> dict[str, Text]:
    """The ids of every row of the table of a kind, by the key that names them."""
    table: Any = getattr(block, _TABLES[edit.family])
    if edit.family == "geodetic":
        return {"from": table.start, "to": table.end, "via": table.via, "group": table.group}
    if edit.kind == "fiducial":
        return {"image": block.images.id[table.image], "point": block.fiducials.id[table.fiducial]}
    named = {}
    if hasattr(table, "image"):
        named["image"] = block.images.id[table.image]
    if hasattr(table, "point"):
        named["point"] = block.points.id[table.point]
    return named | ({"group": table.group} if hasattr(table, "group") else {})


def _rows(block: Block, edit: Edit, ids: dict[str, str], faults: Faults) -> Int | None:
    """Rows that an edit names in the table of its kind; None, and a fault, where there are none."""
    names, before = _names(block, edit), len(faults)
    table: Any = getattr(block, _TABLES[edit.family])
    same = np.ones(len(table), dtype=bool) if edit.family != "geodetic" else table.type == edit.kind
    for key, name in ids.items():
        if key == "to" and edit.family != "geodetic":
            continue
        if key not in names:
            faults.add(f"{edit}: a {edit.kind} has no {key}", edit.where, "leave it out")
        elif not (names[key] == name).any():
            near = did_you_mean(name, np.unique(names[key]).tolist())
            faults.add(f"{edit}: no {edit.kind} has {key} {clipped(name)}{near}", edit.where, REMEDY)
        else:
            same &= names[key] == name
    rows = np.flatnonzero(same)
    if edit.value:
        fits = [_equal(measured_value(block, edit.family, k), edit.value) for k in rows.tolist()]
        rows = rows[np.array(fits, dtype=bool)]
    if not len(rows) and len(faults) == before:
        was = f" with the value {list(edit.value)}" if edit.value else ""
        faults.add(f"{edit}: the block has no such observation{was}", edit.where, REMEDY)
    return rows if len(faults) == before else None


def _equal(value: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return len(value) == len(other) and bool(np.allclose(value, other, rtol=SAME_PRINTED, atol=SAME_PRINTED))


def _switch_off(block: Block, edit: Edit, rows: Int, _faults: Faults) -> Block:
    axes = _axes(edit)
    table: Any = getattr(block, _TABLES[edit.family])
    if edit.family in ("image_point", "geodetic"):
        table = replace(table, active=_set(table.active, rows, None, False))
    elif edit.family == "fiducial":
        table = table.take(np.setdiff1d(np.arange(len(table)), rows))
    elif edit.family == "control":
        table = replace(table, role=_set(table.role, rows, axes, NO_ROLE), xyz_m=_set(table.xyz_m, rows, axes, np.nan))
    elif edit.family == "position":
        position = _set(table.position_m, rows, axes, np.nan)
        use = np.where(np.isfinite(position).any(axis=1), table.position_use, APPROXIMATE_VALUE).astype(np.int32)
        table = replace(table, position_m=position, position_use=use)
    else:
        use = _set(table.angle_use, rows, None, APPROXIMATE_VALUE)
        table = replace(table, angles_rad=_set(table.angles_rad, rows, np.arange(3), np.nan), angle_use=use)
    return _listed(replace(block, **{_TABLES[edit.family]: table}), edit, len(rows))


def _axes(edit: Edit) -> Int:
    """Columns of the coordinates that are meant."""
    return np.array(["XYZ".index(axis) for axis in edit.coordinates])


def _set(values: Any, rows: Int, axes: Int | None, value: float) -> Any:
    """A copy with a value in rows, and columns, of it."""
    changed = values.copy()
    changed[rows if axes is None else np.ix_(rows, axes)] = value
    return changed


def _listed(block: Block, edit: Edit, count: int) -> Block:
    """What is switched off stands among the rejects, with the number of observations where the edit names several."""
    ids = [edit.ids[key] for key in ("image", "point", "from", "to") if key in edit.ids]
    by = BY_EDIT if count == 1 else f"{BY_EDIT}, all {count} that are called so"
    reason = f"{by}: {edit.reason}" if edit.reason else by
    listed = Rejects.of(kind=[edit.kind], id=["/".join(ids)], reason=reason)
    return replace(block, rejects=block.rejects.followed_by(listed))


def _renumber(block: Block, edit: Edit, rows: Int, faults: Faults) -> Block:
    table, to = block.image_points, edit.ids["to"]
    new = np.flatnonzero(block.points.id == to)
    if not len(new):
        near = did_you_mean(to, block.points.id.tolist())
        faults.add(f"{edit}: the block has no point {clipped(to)}{near}", edit.where, REMEDY)
        return block
    if ((table.image == table.image[rows[0]]) & (table.point == new[0]) & table.active).any():
        faults.add(f"{edit}: the image has that point already", edit.where, "exchange them, or switch one off")
        return block
    return _sorted(block, _set(table.point, rows, None, new[0]))


def _sorted(block: Block, point: Int) -> Block:
    table = replace(block.image_points, point=point)
    return replace(block, image_points=table.take(image_point_order(table)))


_EXCHANGED = {
    "control": ("xyz_m", "covariance_m2", "role"),
    "position": ("position_m", "position_covariance_m2", "position_use", "refers_to", "drift_group"),
}
"""Columns in which two rows are exchanged: a coordinate goes with what it is taken for, control or check."""


def _exchange(block: Block, edit: Edit, rows: Int, faults: Faults) -> Block:
    """Both observations keep their place and get what was measured of the other, and as what."""
    key = "image" if edit.kind == "position" else "point"
    if edit.ids["to"] == edit.ids[key]:
        faults.add(f"{edit}: one {key} cannot be exchanged with itself", edit.where, "name two, or delete the line")
        return block
    others = _rows(block, replace(edit, value=()), {**edit.ids, key: edit.ids["to"]}, faults)
    if others is None:
        return block
    if edit.kind == "image_point":
        point = block.image_points.point.copy()
        point[rows], point[others] = point[others[0]], point[rows[0]]
        return _sorted(block, point)
    name, correlated = _TABLES[edit.kind], block.ground_point_covariances
    table: Any = getattr(block, name)
    if edit.kind == "control" and np.isin([correlated.row_a, correlated.row_b], [rows[0], others[0]]).any():
        faults.add(f"{edit}: it is correlated with other points", edit.where, "exchange the names in the files")
        return block
    columns = {}
    for column in _EXCHANGED[edit.kind]:
        values = getattr(table, column).copy()
        values[[rows[0], others[0]]] = values[[others[0], rows[0]]]
        columns[column] = values
    return replace(block, **{name: replace(table, **columns)})


def _reweight(block: Block, edit: Edit, rows: Int, faults: Faults) -> Block:
    """Standard deviations times the factor; correlations stay, those with other observations too."""
    table: Any = getattr(block, _TABLES[edit.family])
    if edit.kind in BY_COORDINATE:
        column = "covariance_m2" if edit.kind == "control" else "position_covariance_m2"
        factor = _set(np.ones((len(table), 3)), rows, _axes(edit), edit.factor)
        scaled = getattr(table, column) * factor[:, :, None] * factor[:, None, :]
    else:
        column = {"image_point": "sigma_mm", "attitude": "angle_sigma_rad"}.get(edit.kind, "sigma")
        factor = _set(np.ones(len(table)), rows, None, edit.factor)
        scaled = (getattr(table, column).T * factor).T
    if np.array_equal(scaled, getattr(table, column), equal_nan=True) and edit.factor != 1:
        faults.add(f"{edit}: standard deviations are 0 or not stated there", edit.where, "state them in the block")
        return block
    block = replace(block, **{_TABLES[edit.family]: replace(table, **{column: scaled})})
    if edit.kind == "control":
        c = block.ground_point_covariances
        value = c.value * factor[c.row_a, c.axis_a] * factor[c.row_b, c.axis_b]
        return replace(block, ground_point_covariances=replace(c, value=value))
    if edit.family == "geodetic":
        g = block.geodetic_covariances
        value = g.value * factor[g.row_a] * factor[g.row_b]
        return replace(block, geodetic_covariances=replace(g, value=value))
    return block


_DO: dict[str, Callable[[Block, Edit, Int, Faults], Block]] = {
    "switch_off": _switch_off,
    "renumber": _renumber,
    "exchange": _exchange,
    "reweight": _reweight,
}
