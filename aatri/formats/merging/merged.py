"""Blocks merged to one: ids matched, what is in several of them counted once, what contradicts told.

Table by table the rows of a block are looked for among those of the blocks before it, by what identifies them: images,
points, cameras and strips by their ids, image points by image and point, given coordinates by their point, positions by
their image. Equal rows count once. Measurements of one thing that agree are averaged, see `rows`; sights on
the ground that differ are further sights. What identifies nothing new but says other things is a conflict. Frame, earth
curvature and system of rotations have to be the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.codes import CHECK, CONTROL
from aatri.errors import InputError, raise_all
from aatri.formats.limits import FEWEST_SHIFTED, SAME_SHIFT
from aatri.formats.merging.differing import DifferingRows, excluded, exterior, ground, images, measured
from aatri.formats.merging.part import TABLE_OF_KIND, in_canonical_order
from aatri.formats.merging.rows import (
    Conflicts,
    Duplicates,
    Joined,
    Reconciliation,
    joined_by,
    merged_conditions,
    with_rows,
)
from aatri.ids import amounts, printable, shown
from aatri.progress import Reporter
from aatri.tables.schema import columns_of, tables_of

IDENTIFIES: dict[str, tuple[str, ...]] = {
    "cameras": ("id",),
    "camera_parameters": ("camera", "name"),
    "distortion_table": ("camera", "radius_mm"),
    "fiducials": ("camera", "id"),
    "rig_members": ("rig", "member"),
    "strips": ("id",),
    "images": ("id",),
    "fiducial_points": ("image", "fiducial"),
    "points": ("id",),
    "image_points": ("image", "point"),
    "ground_points": ("point",),
    "ground_point_covariances": ("row_a", "axis_a", "row_b", "axis_b"),
    "exterior": ("image",),
    "geodetic": ("type", "start", "end", "via", "start_kind", "end_kind", "set", "group"),
    "geodetic_covariances": ("row_a", "row_b"),
    "model_coordinates": ("model", "point"),
    "true_images": ("image",),
    "true_points": ("point",),
    "gross_errors": ("kind", "row"),
    "rejects": ("kind", "id", "reason"),
}
"""Columns by which a row is known again; tables in an order in which rows point back."""

WHOLE = ("camera_parameters", "distortion_table", "fiducials")
"""Of a camera that two blocks have, these have to be whole in both."""

OBSERVATIONS = (
    "image_points",
    "fiducial_points",
    "ground_points",
    "exterior",
    "geodetic",
    "model_coordinates",
    "relative_control",
)
"""Tables of which a block has to bring a row."""

SAME_IN_ALL = ("rotation", "earth_curvature", "heading", "undulation_m")


def merged(
    blocks: Sequence[Block],
    names: Sequence[str],
    reporter: Reporter,
    *,
    name: str = "",
    duplicates: Duplicates = "average",
    conflicts: Conflicts = "refuse",
    sigmas: float,
    unconnected: bool = False,
) -> Block:
    """Several blocks as one.

    Parameters
    ----------
    names : sequence of str
        What messages call them.
    name : str
        Of the merged block; empty: those of the blocks.
    duplicates : str
        What becomes of two measurements that agree: `average`, `first` or `refuse`.
    conflicts : str
        What becomes of values that exclude each other: `refuse` or `first`.
    sigmas : float
        Up to so many standard deviations of their difference two measurements agree.
    unconnected : bool
        Blocks without a common image or point may stand side by side.

    Raises
    ------
    InputError
        If blocks contradict each other, have nothing in common, or one holds nothing that the others do not.
    """
    block, called = blocks[0], names[0]
    for other, second in zip(blocks[1:], names[1:]):
        rules = Reconciliation(called, second, duplicates, conflicts, sigmas)
        block = _merged_pair(block, other, rules, reporter, unconnected=unconnected)
        called = f"{called}, {second}"
    name = name or "+".join(dict.fromkeys(b.name for b in blocks))
    return replace(in_canonical_order(block), name=name)


def _merged_pair(a: Block, b: Block, rules: Reconciliation, reporter: Reporter, *, unconnected: bool) -> Block:
    _check_frames(a, b, rules)
    place: dict[str, Int] = {"files": np.append(len(a.files) + np.arange(len(b.files)), -1)}
    tables: dict[str, Any] = {"files": a.files.followed_by(b.files)}
    count: dict[str, tuple[int, int]] = {}
    for name, key in IDENTIFIES.items():
        first, second = _both(a, b, name, place)
        if first is None:
            continue
        joined = joined_by(first, second, key, ("file", "line") if name == "rejects" else ("file", "line", "active"))
        fresh = ~joined.equal if name == "geodetic" else joined.fresh  # one sight more is no contradiction
        if name != "geodetic" and len(joined.differing):
            pairs = DifferingRows(joined.row[joined.differing], joined.differing, _namer(b, name), _reader(b, name))
            first = _reconciled(a, name, first, second, pairs, rules)
        if name in WHOLE:
            _check_whole(a, name, (first, second), joined, rules)
        if name in ("images", "image_points"):
            again = joined.equal & second.active
            first = with_rows(first, joined.row[again], active=True)
        place[name] = np.append(np.where(fresh, len(first) + np.cumsum(fresh) - 1, joined.row), -1)
        tables[name] = first.followed_by(second.take(fresh))
        count[name] = int((~fresh).sum()), int(fresh.sum())
    conditions = merged_conditions(a, b, rules)
    if rules.faults and (fault := _datum_fault(a, b, rules)):
        rules.faults.insert(0, fault)
    raise_all(rules.faults)
    count["relative_control"] = 0, len(conditions[0]) - len(a.relative_control)
    _check_common(count, rules, unconnected=unconnected)
    _tell(count, rules, reporter)
    heights = [h for h in (a.terrain_height_m, b.terrain_height_m) if np.isfinite(h)]
    return replace(
        a,
        **tables,
        relative_control=conditions[0],
        relative_control_members=conditions[1],
        terrain_height_m=float(np.mean(heights)) if heights else float("nan"),
    )


def _both(a: Block, b: Block, name: str, place: dict[str, Int]) -> tuple[Any, Any]:
    """A table of both blocks, row numbers of the second those of the merged block; one that a block lacks is empty."""
    first, second = getattr(a, name), getattr(b, name)
    if first is None and second is None:
        return None, None
    kind: Any = tables_of(Block)[name]
    first, second = (kind.empty() if table is None else table for table in (first, second))
    moved = {
        column_name: place[c.refers][getattr(second, column_name)]
        for column_name, c in columns_of(kind).items()
        if c.refers in place
    }
    if name == "gross_errors":
        of_kind = [TABLE_OF_KIND.get(row_kind, "geodetic") for row_kind in second.kind.tolist()]
        moved["row"] = np.array([place[t][row] for t, row in zip(of_kind, second.row.tolist())], dtype=np.int32)
    return first, replace(second, **moved)


def _reconciled(a: Block, name: str, first: Any, second: Any, pairs: DifferingRows, rules: Reconciliation) -> Any:
    """The rows of the first table, after what the second says otherwise."""
    if name in ("image_points", "fiducial_points"):
        kind = "image point" if name == "image_points" else "fiducial"
        pixel = (a.cameras.image_coordinates == "pixel")[:, None]
        mm_per_unit = np.where(pixel, a.cameras.pixel_size_mm, 1.0)[a.images.camera]
        return measured(first, second, pairs, rules, kind, mm_per_unit)
    settle: dict[str, Any] = {"images": images, "ground_points": ground, "exterior": exterior}
    return settle.get(name, excluded)(first, second, pairs, rules)


def _reader(b: Block, name: str) -> Callable[[int], str]:
    """Where a row of a table was read."""
    table: Any = getattr(b, name)
    return lambda k: b.read_at(table, k) if hasattr(table, "file") else ""


def _namer(b: Block, name: str) -> Callable[[int], str]:
    """What messages call a row of a table."""
    value: Any = getattr(b, name)
    mark = {"camera_parameters": "name", "distortion_table": "radius_mm", "fiducials": "id"}

    def named(k: int) -> str:
        if name in ("image_points", "fiducial_points"):
            of_image = b.points.id[value.point[k]] if name == "image_points" else b.fiducials.id[value.fiducial[k]]
            return f"{b.images.id[value.image[k]]}/{of_image}"
        if name in ("ground_points", "true_points"):
            return str(b.points.id[value.point[k]])
        if name in ("exterior", "true_images"):
            return str(b.images.id[value.image[k]])
        if name in WHOLE:
            return f"camera {printable(str(b.cameras.id[value.camera[k]]))}, {name} {getattr(value, mark[name])[k]}"
        if name == "model_coordinates":
            return f"point {printable(str(b.points.id[value.point[k]]))} of model {printable(str(value.model[k]))}"
        if name == "rig_members":
            return f"member {printable(str(value.member[k]))} of rig {printable(str(value.rig[k]))}"
        if hasattr(value, "id"):
            return f"{name.removesuffix('s')} {printable(str(value.id[k]))}"
        return f"{name} {k + 1}"

    return named


def _check_frames(a: Block, b: Block, rules: Reconciliation) -> None:
    """Frame, earth curvature and rotations have to be the same: values of one block mean the same in the other."""
    frames = [(f.axes[0], f.crs[0], f.vertical[0]) for f in (a.frames, b.frames)]
    if frames[0] != frames[1]:
        words = [" ".join(filter(None, (crs, vertical, f"({axes})"))) for axes, crs, vertical in frames]
        remedy = "`crs` and `vertical` beside the path of a file that names none; else `block/combined` with these"
        if frames[0][1:] == frames[1][1:]:
            remedy = "the same `axes` in both: [east, north, up] where Z is the height"
        what = f"{rules.first} is in the frame {words[0]}, {rules.second} in {words[1]}"
        raise InputError(what, remedy=remedy)
    for name in SAME_IN_ALL:
        values = getattr(a, name), getattr(b, name)
        if values[0] != values[1] and not all(isinstance(v, float) and np.isnan(v) for v in values):
            rules.faults.add(
                f"{name} is {values[0]} in {rules.first}, {values[1]} in {rules.second}",
                remedy="state the same in both blocks (block.yaml)",
            )
    raise_all(rules.faults)


def _check_whole(a: Block, name: str, tables: tuple[Any, Any], joined: Joined, rules: Reconciliation) -> None:
    """What belongs to a camera of both blocks has to be in both: a parameter in one alone is another camera."""
    first, second = tables
    for camera in np.intersect1d(second.camera, np.arange(len(a.cameras))).tolist():
        own = second.camera == camera
        counts = int((first.camera == camera).sum()), int(own.sum())
        if counts[0] != counts[1] or (own & joined.fresh).any():
            rules.conflict(f"camera {printable(str(a.cameras.id[camera]))}: rows of {name}", counts)


def _datum_fault(a: Block, b: Block, rules: Reconciliation) -> InputError | None:
    """An error where all common control and check points differ by one shift: another datum, not errors of points."""
    rows, xyz, covariance = [], [], []
    _, i, j = np.intersect1d(
        a.points.id[a.ground_points.point], b.points.id[b.ground_points.point], return_indices=True
    )
    for block, k in ((a, i), (b, j)):
        ground = block.ground_points.take(k)
        rows.append(np.isin(ground.role, (CONTROL, CHECK)).all(axis=1) & np.isfinite(ground.xyz_m).all(axis=1))
        xyz.append(ground.xyz_m)
        covariance.append(np.diagonal(ground.covariance_m2, axis1=1, axis2=2))
    both = rows[0] & rows[1]
    shift, sigma = (xyz[1] - xyz[0])[both], np.sqrt(covariance[0] + covariance[1])[both]
    if len(shift) < FEWEST_SHIFTED or not (np.abs(shift) > rules.sigmas * sigma).any(axis=1).all():
        return None
    common = np.median(shift, axis=0)
    if (np.abs(shift - common) > np.maximum(rules.sigmas * sigma, SAME_SHIFT * np.abs(common).max())).any():
        return None
    return InputError(
        f"all {len(shift)} common control and check points of {rules.second} lie ({common[0]:.3f}, {common[1]:.3f}, "
        f"{common[2]:.3f}) m from those of {rules.first}: another datum",
        remedy=f"bring {rules.second} into the datum of {rules.first} before they are merged",
    )


def _check_common(count: dict[str, tuple[int, int]], rules: Reconciliation, *, unconnected: bool) -> None:
    if not (count["images"][0] or count["points"][0] or unconnected):
        raise InputError(
            f"{rules.first} and {rules.second} have neither an image nor a point in common",
            remedy="give common points the same id (`rename`), or set `unconnected: true` to adjust them side by side",
        )
    if not any(count[name][1] for name in OBSERVATIONS if name in count):
        first, second = rules.first, rules.second
        raise InputError(
            f"{second} holds nothing that {first} does not hold: the same block twice, or a part of it",
            remedy="leave it out, or give its ids a prefix if it is another block",
        )


def _tell(count: dict[str, tuple[int, int]], rules: Reconciliation, reporter: Reporter) -> None:
    for text in rules.warnings:
        reporter.warn(text)
    for kind, averaged in rules.means.items():
        reporter.log(f"{kind}: {len(averaged)} averaged over {rules.first} and {rules.second}: {shown(averaged)}")
    common = amounts({name: n[0] for name, n in count.items() if name != "rejects"})
    reporter.log(f"common to {rules.first} and {rules.second}: {common or 'nothing'}")
