"""Chosen rows of the tables of a Block, in any order, with all row numbers that point at them following."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.arrays import Int
from aatri.artifacts.block import Block, GrossErrors
from aatri.artifacts.builder import geodetic_order, image_point_order
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
