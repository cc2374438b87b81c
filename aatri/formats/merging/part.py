"""A part of a block: some of its images, with all that belongs to them.

Rows of the tables of a Block are chosen, in any order, and all row numbers that point at them follow.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.arrays import Bool, Int
from aatri.artifacts.block import Block, GrossErrors
from aatri.artifacts.builder import geodetic_order, image_point_order
from aatri.formats.tables.relative_control import conditions_of, tables_of_conditions
from aatri.tables.schema import columns_of, tables_of

TABLE_OF_KIND = {
    "image_point": "image_points",
    "fiducial": "fiducial_points",
    "control": "ground_points",
    "position": "exterior",
    "attitude": "exterior",
}
"""Tables of the kinds of observations; all others are in `geodetic`."""


def taken(block: Block, chosen: Mapping[str, Int]) -> Block:
    """The block with the chosen rows of some tables.

    Rows that point at one which is not chosen have to be left out too, unless their column may say *none*.

    Parameters
    ----------
    chosen : mapping of table to (n,) int
        Rows in their new order; tables that are not named keep theirs.
    """
    place: dict[str, Int] = {}
    for name, rows in chosen.items():
        place[name] = np.full(len(getattr(block, name)) + 1, -1)
        place[name][rows] = np.arange(len(rows))
    tables: dict[str, Any] = {}
    for name, kind in tables_of(Block).items():
        table: Any = getattr(block, name)
        if table is None:
            continue
        if name in chosen:
            table = table.take(chosen[name])
        moved = {
            column_name: place[c.refers][getattr(table, column_name)]
            for column_name, c in columns_of(kind).items()
            if c.refers in place
        }
        tables[name] = replace(table, **moved) if moved else table
    if block.gross_errors is not None:
        tables["gross_errors"] = _gross_errors(block.gross_errors, place)
    return replace(block, **tables)


def _gross_errors(rows: GrossErrors, place: Mapping[str, Int]) -> GrossErrors:
    """Gross errors of the rows that are left."""
    moved = rows.row.copy()
    for kind in np.unique(rows.kind).tolist():
        table, own = TABLE_OF_KIND.get(kind, "geodetic"), rows.kind == kind
        if table in place:
            moved[own] = place[table][rows.row[own]]
    return replace(rows, row=moved).take(moved >= 0)


def in_canonical_order(block: Block) -> Block:
    """The block with its rows in the order that they have whatever the order of the input; see `artifacts.block`."""
    rigs = block.rig_members
    order: dict[str, Any] = {
        name: np.argsort(getattr(block, name).id, kind="stable") for name in ("cameras", "strips", "images", "points")
    }
    order["rig_members"] = np.lexsort((rigs.member, ~rigs.is_frame, rigs.rig))
    block = taken(block, order)
    of_cameras, tables = block.camera_parameters, block.distortion_table
    block = taken(
        block,
        {
            "camera_parameters": np.lexsort((of_cameras.name, of_cameras.camera)),
            "distortion_table": np.lexsort((tables.radius_mm, tables.camera)),
            "fiducials": np.argsort(block.fiducials.camera, kind="stable"),
        },
    )
    marks, sights, models = block.fiducial_points, block.geodetic, block.model_coordinates
    order = {
        "fiducial_points": np.lexsort((marks.fiducial, marks.image)),
        "image_points": image_point_order(block.image_points),
        "ground_points": np.argsort(block.ground_points.point, kind="stable"),
        "exterior": np.argsort(block.exterior.image, kind="stable"),
        "geodetic": geodetic_order(sights),
    }
    if models is not None:
        order["model_coordinates"] = np.lexsort((models.point, models.model))
    for name, column_name in (("true_images", "image"), ("true_points", "point")):
        truth: Any = getattr(block, name)
        if truth is not None:
            order[name] = np.argsort(getattr(truth, column_name), kind="stable")
    block = taken(block, order)
    wrong = block.gross_errors
    if wrong is not None:
        _, first, kind = np.unique(wrong.kind, return_index=True, return_inverse=True)
        block = replace(block, gross_errors=wrong.take(np.lexsort((wrong.row, first[kind]))))
    between, correlated = block.ground_point_covariances, block.geodetic_covariances
    a, b = 3 * between.row_a + between.axis_a, 3 * between.row_b + between.axis_b
    a, b = np.minimum(a, b), np.maximum(a, b)
    between = replace(between, row_a=a // 3, axis_a=a % 3, row_b=b // 3, axis_b=b % 3).take(np.lexsort((b, a)))
    a, b = (f(correlated.row_a, correlated.row_b) for f in (np.minimum, np.maximum))
    correlated = replace(correlated, row_a=a, row_b=b).take(np.lexsort((b, a)))
    return replace(block, ground_point_covariances=between, geodetic_covariances=correlated)


def part_of(block: Block, images: Bool) -> Block:
    """Some images with their image points, the points these show, and what is observed of both alone.

    Sights and conditions are left out that touch a point or an image outside; points that sights or conditions join to
    points of the part alone, and to no image, belong to it.

    Parameters
    ----------
    images : (n_images,) bool
    """
    rays, models = block.image_points, block.model_coordinates
    points = np.zeros(len(block.points), dtype=bool)
    points[rays.point[images[rays.image]]] = True
    seen = np.zeros(len(points), dtype=bool)
    seen[rays.point] = True
    names = {"image": set(block.images.id[images].tolist()), "point": set(block.points.id[points | ~seen].tolist())}
    sights, conditions = block.geodetic, conditions_of(block)
    inside = np.array(
        [
            a in names[of_a] and b in names[of_b] and (not via or via in names["point"])
            for a, of_a, b, of_b, via in zip(
                *(getattr(sights, n).tolist() for n in ("start", "start_kind", "end", "end_kind", "via"))
            )
        ],
        dtype=bool,
    )
    names_of = {"images": names["image"]}
    kept = [c for c in conditions if all(name in names_of.get(part, names["point"]) for part, name in c.members)]
    touched = {name for c in kept for part, name in c.members if part != "images"}
    for end in ("start", "end"):
        touched |= set(getattr(sights, end)[inside & (getattr(sights, f"{end}_kind") == "point")].tolist())
    points |= np.isin(block.points.id, list(touched | set(sights.via[inside].tolist())))
    ground, between, correlated = block.ground_points, block.ground_point_covariances, block.geodetic_covariances
    of_ground = points[ground.point]
    cameras = np.isin(np.arange(len(block.cameras)), block.images.camera[images])
    marks = cameras[block.fiducials.camera]
    rows: dict[str, Any] = {
        "cameras": cameras,
        "camera_parameters": cameras[block.camera_parameters.camera],
        "distortion_table": cameras[block.distortion_table.camera],
        "fiducials": marks,
        "rig_members": np.isin(block.rig_members.rig, block.images.rig[images]),
        "strips": np.isin(np.arange(len(block.strips)), block.images.strip[images]),
        "images": images,
        "fiducial_points": images[block.fiducial_points.image],
        "points": points,
        "image_points": images[rays.image],
        "ground_points": of_ground,
        "ground_point_covariances": of_ground[between.row_a] & of_ground[between.row_b],
        "exterior": images[block.exterior.image],
        "geodetic": inside,
        "geodetic_covariances": inside[correlated.row_a] & inside[correlated.row_b],
    }
    if models is not None:
        rows["model_coordinates"] = points[models.point]
    if block.true_images is not None:
        rows["true_images"] = images[block.true_images.image]
    if block.true_points is not None:
        rows["true_points"] = points[block.true_points.point]
    control, members = tables_of_conditions(kept)
    part = replace(block, relative_control=control, relative_control_members=members)
    return taken(part, {name: np.flatnonzero(chosen) for name, chosen in rows.items()})
