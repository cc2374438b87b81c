"""The parts of several sources as those of one: images, cameras and points are the same where their names match.

The first source that has images says which there are; where it is a list of image points alone, as of an image or a
strip, all such lists of its format do. What others say of images goes by the rule of `conventions.names`. Of two
sources that give the same thing

- a measured or observed value comes before a start value, whichever file it is in;
- two start values, or two cameras of a name: the first source wins, by a warning where they differ;
- two controls of a point or two observed positions of an image that differ are an error with both places.

Names that match nothing are left out, by a warning. Every row keeps its file and line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Bool, Text
from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.names import OF_IMAGES, OF_POINTS, Step, matched
from aatri.formats.limits import SAME_M
from aatri.formats.parts.block_parts import KINDS, BlockParts, Rows, place, rows_of, taken, together, twice
from aatri.ids import shown
from aatri.progress import Reporter


@dataclass
class JoinedParts:
    """Tables of all sources together, and the files that their rows count in."""

    files: list[Path]
    tables: dict[str, Rows] = field(default_factory=dict)


def joined(sources: Sequence[BlockParts], reporter: Reporter) -> JoinedParts:
    """Join sources.

    Raises
    ------
    InputError
        If no source has images, an id stands twice, or observed values differ.
    """
    files = [path for parts in sources for path in parts.files]
    first = np.cumsum([0, *(len(parts.files) for parts in sources)]).tolist()
    tables = [{kind: rows_of(p, kind, f) for kind in KINDS} for p, f in zip(sources, first)]
    base = next((k for k, t in enumerate(tables) if t["images"] or t["image_points"]), None)
    if base is None:
        base = next((k for k, t in enumerate(tables) if t["exterior"]), None)
    if base is None:
        what = f"no source has images or image points: {', '.join(p.format for p in sources)}"
        raise InputError(what, where=str(files[0]) if files else "", remedy="add the file with the image points")
    images = _images_of_lists(tables, sources, base)
    for k, of_source in enumerate(tables):
        if k != base:
            _rename_images(of_source, images, sources[k], reporter)
    _rename_points(tables, sources, reporter)
    _rename_cameras(tables, sources, reporter)
    made = JoinedParts(files)
    made.tables["cameras"] = _cameras(tables, files, reporter)
    of_camera = [(t["camera_parameters"], set(t["cameras"].get("id", ()))) for t in tables]
    made.tables["camera_parameters"] = _of_first_camera(of_camera)
    made.tables["image_points"] = together([t["image_points"] for t in tables])
    made.tables["images"] = _images(images, [tables[base], *(t for k, t in enumerate(tables) if k != base)])
    made.tables["ground_points"] = _ground_points(tables, files, reporter)
    made.tables["exterior"] = _exterior(tables, files, reporter)
    return made


def _image_names(tables: dict[str, Rows]) -> list[str]:
    listed = [tables["images"].get("id"), tables["image_points"].get("image"), tables["exterior"].get("image")]
    columns = listed[:2] if tables["images"] or tables["image_points"] else listed
    return list(dict.fromkeys(str(name) for column in columns if column is not None for name in column.tolist()))


def _images_of_lists(tables: Sequence[dict[str, Rows]], sources: Sequence[BlockParts], base: int) -> list[str]:
    """Images of the base; of lists of image points, those of every further list of its format too."""
    images = _image_names(tables[base])
    for k, of_source in enumerate(tables):
        lists = all(t["image_points"] and not t["images"] for t in (of_source, tables[base]))
        if k != base and lists and sources[k].format == sources[base].format:
            images += matched(_image_names(of_source), images, OF_IMAGES).unmatched
    return images


def _rename_images(tables: dict[str, Rows], images: list[str], parts: BlockParts, reporter: Reporter) -> None:
    """Call the images of a source what they are called in the block; leave out rows of those that it does not have."""
    names = dict.fromkeys(
        str(name)
        for table, key in (("images", "id"), ("image_points", "image"), ("exterior", "image"))
        for name in tables[table].get(key, np.zeros(0, "U1")).tolist()
    )
    if not names:
        return
    matching = matched(names, images, OF_IMAGES)
    _tell(matching.in_words("image names"), parts, reporter)
    if not matching.name:
        what = f"none of its {len(names)} image names is one of the block: {shown(names, 3)}; there: {shown(images, 3)}"
        raise InputError(what, where=str(parts.files[0]), remedy="give the list of the same flight, or mend the names")
    if matching.unmatched:
        what = f"{len(matching.unmatched)} of its {len(names)} images are not in the block, and are left out"
        reporter.warn(f"{parts.files[0]}: {what}: {shown(matching.unmatched)}")
    for table, key in (("images", "id"), ("image_points", "image"), ("exterior", "image")):
        tables[table] = _renamed(tables[table], key, matching.name)
        twice(tables[table], key, "image", parts.files) if table != "image_points" else None


def _rename_points(tables: list[dict[str, Rows]], sources: Sequence[BlockParts], reporter: Reporter) -> None:
    """Call the points of each source what the sources before call them; others keep their name."""
    names_before: dict[str, None] = {}
    for of_source, parts in zip(tables, sources):
        names = dict.fromkeys(
            [str(n) for t in ("ground_points", "image_points") for n in of_source[t].get("point", np.zeros(0)).tolist()]
        )
        renamed = _matched_names(names, names_before, OF_POINTS, "point names", parts, reporter) if names_before else {}
        for table in ("ground_points", "image_points"):
            of_source[table] = _renamed(of_source[table], "point", {n: renamed.get(n, n) for n in names})
        names_before |= dict.fromkeys(renamed.get(name, name) for name in names)


def _rename_cameras(tables: list[dict[str, Rows]], sources: Sequence[BlockParts], reporter: Reporter) -> None:
    """Call the cameras of each source what the sources before call them.

    Where the images name one camera, or none at all, and one source gives one camera, that is it.
    """
    named = {str(n) for t in tables for n in t["images"].get("camera", np.zeros(0)).tolist()} - {""}
    ids = {str(n) for t in tables for n in t["cameras"].get("id", np.zeros(0)).tolist()}
    for of_source, parts in zip(tables, sources):
        own = [str(name) for name in of_source["cameras"].get("id", np.zeros(0)).tolist()]
        name_of = _matched_names(dict.fromkeys(own), dict.fromkeys(named), OF_POINTS, "camera names", parts, reporter)
        if len(own) == 1 and len(named) == 1 and own[0] not in name_of and not named & ids:
            name_of = {own[0]: next(iter(named))}
            reporter.log(
                f"{parts.files[0]}: camera {own[0]} is taken for {name_of[own[0]]}, the only one of the images"
            )
        names = {name: name_of.get(name, name) for name in own}
        for table, key in (("cameras", "id"), ("camera_parameters", "camera")):
            of_source[table] = _renamed(of_source[table], key, names)


def _matched_names(
    names: dict[str, None],
    names_before: dict[str, None],
    steps: tuple[Step, ...],
    what: str,
    parts: BlockParts,
    to: Reporter,
) -> dict[str, str]:
    matching = matched(names, names_before, steps)
    _tell(matching.in_words(what), parts, to)
    return dict(matching.name)


def _tell(sentences: list[str], parts: BlockParts, reporter: Reporter) -> None:
    for sentence in sentences:
        reporter.warn(f"{parts.files[0]}: {sentence}") if "could be" in sentence else reporter.log(
            f"{parts.files[0]}: {sentence}"
        )


def _renamed(rows: Rows, key: str, names: dict[str, str] | Any) -> Rows:
    """Rows with other names; those without one are left out."""
    if not rows:
        return rows
    new = [names.get(str(name), "") for name in rows[key].tolist()]
    kept = taken({**rows, key: np.array(new, dtype=np.str_)}, np.array([bool(name) for name in new], dtype=bool))
    return kept if len(kept[key]) else {}


def _cameras(tables: list[dict[str, Rows]], files: Sequence[Path], reporter: Reporter) -> Rows:
    """Each camera once: of the first source that has it, by a warning where another one says something else."""
    rows = together([t["cameras"] for t in tables])
    if not rows:
        return {}
    chosen: dict[str, int] = {}
    for k, name in enumerate(rows["id"].tolist()):
        first = chosen.setdefault(name, k)
        if first != k and np.isnan(rows["principal_distance_mm"][first]):
            chosen[name] = k
        elif first != k and not _alike(rows, first, k):
            at, there = place(rows, k, files), place(rows, first, files)
            reporter.warn(f"{at}: camera {name} is another one than that of {there}, which is taken")
    return taken(rows, sorted(chosen.values()))


def _alike(rows: Rows, a: int, b: int) -> bool:
    return all(
        np.array_equal(v[a], v[b], equal_nan=v.dtype.kind == "f") for n, v in rows.items() if n not in ("file", "line")
    )


def _of_first_camera(tables: list[tuple[Rows, set[str]]]) -> Rows:
    taken_before: set[str] = set()
    kept = []
    for parameters, cameras in tables:
        if parameters:
            kept.append(taken(parameters, ~np.isin(parameters["camera"], sorted(taken_before))))
        taken_before |= {str(c) for c in cameras}
    return together(kept)


def _images(names: list[str], tables: list[dict[str, Rows]]) -> Rows:
    """The images, each with what the sources say of it: the first that says anything of a column."""
    stated = [t["images"] for t in tables if t["images"]]
    rows = rows_of(BlockParts("", [], images={"id": names}), "images")
    row = {name: k for k, name in enumerate(names)}
    for columns in stated:
        at = np.array([row[str(name)] for name in columns["id"].tolist()], dtype=np.intp)
        for name, values in columns.items():
            if name != "id":
                open_ = _not_stated(rows[name][at])
                column = rows[name] if rows[name].dtype.kind != "U" else rows[name].astype(object)
                column[at[open_]] = values[open_]
                rows[name] = column.astype(np.str_) if column.dtype == object else column
    return rows


def _not_stated(values: Any) -> Bool:
    if values.dtype.kind == "f":
        return np.asarray(np.isnan(values))
    if values.dtype.kind in "iu":
        return np.asarray(values < 0)
    return np.asarray(values == "") if values.dtype.kind == "U" else np.ones(len(values), bool)


def _ground_points(tables: list[dict[str, Rows]], files: Sequence[Path], reporter: Reporter) -> Rows:
    """Each point once: control and check points before start values."""
    rows = together([t["ground_points"] for t in tables])
    if not rows:
        return {}
    is_ground = np.asarray(np.isin(rows["role"], (CONTROL, CHECK)).any(axis=1))
    chosen = _chosen(rows["point"], is_ground, rows, "xyz_m", "ground point", files, reporter)
    return taken(rows, chosen)


def _exterior(tables: list[dict[str, Rows]], files: Sequence[Path], reporter: Reporter) -> Rows:
    """Position and attitude of each image, each of the source that observed it, else of the first that gives it."""
    rows = together([t["exterior"] for t in tables])
    if not rows:
        return {}
    has_position = np.isfinite(rows["position_m"]).any(axis=1)
    has_attitude = np.isfinite(rows["angles_rad"]).any(axis=1) | np.isfinite(rows["ground_from_image"]).all(axis=(1, 2))
    with_position, with_attitude = np.flatnonzero(has_position), np.flatnonzero(has_attitude)
    position, attitude = (
        _chosen(rows["image"][k], rows[use][k] == OBSERVED_VALUE, taken(rows, k), column, what, files, reporter)
        for k, use, column, what in (
            (with_position, "position_use", "position_m", "position of image"),
            (with_attitude, "angle_use", "ground_from_image", "attitude of image"),
        )
    )
    of_position = {str(rows["image"][k]): k for k in with_position[position].tolist()}
    of_attitude = {str(rows["image"][k]): k for k in with_attitude[attitude].tolist()}
    names = sorted({*of_position, *of_attitude})
    made = taken(rows, [of_position.get(name, of_attitude.get(name, 0)) for name in names])
    for name in ("angles_rad", "angle_sigma_rad", "angle_use", "ground_from_image"):
        made[name] = made[name].copy()
        for k, image in enumerate(names):
            own = of_attitude.get(image)
            made[name][k] = rows[name][own] if own is not None else (0 if name == "angle_use" else np.nan)
    return made


def _chosen(
    ids: Text, first_rate: Bool, rows: Rows, column: str, what: str, files: Sequence[Path], reporter: Reporter
) -> list[int]:
    """Of each id one row: one that is observed, else the first; what contradicts it is an error, or told."""
    order = np.lexsort((np.arange(len(ids)), ~first_rate, ids))
    chosen: list[int] = []
    others: list[str] = []
    for k in order.tolist():
        if not chosen or ids[chosen[-1]] != ids[k]:
            chosen.append(k)
            continue
        best = chosen[-1]
        gap = float(np.nanmax(np.abs(rows[column][k] - rows[column][best]), initial=0.0))
        if first_rate[k] and gap > SAME_M:
            raise InputError(
                f"{what} {ids[k]} is given otherwise in {place(rows, best, files)}, by up to {gap:.3g}",
                where=place(rows, k, files),
                remedy="give one of the two, or tell the sources what to `take`",
            )
        if gap > SAME_M and first_rate[k] == first_rate[best]:
            others.append(str(ids[k]))
    if others:
        reporter.warn(
            f"{len(others)} times {what} has other start values in a later source, which are not taken: {shown(others)}"
        )
    return sorted(chosen)
