"""covariances.csv: full covariances between geodetic observations, and between given ground coordinates.

Rows of table `geodetic` are counted from 1 in the order of geodetic.csv; their values are in the units of the two
observations. Rows of table `ground_points` are point ids with a coordinate X, Y or Z each; their values are in the
square of units.sigma_ground. One point's own variances and covariances may stand here where its cells sX ... sYZ in
ground_points.csv are empty.
"""

import dataclasses
from typing import Any

import numpy as np

from aatri.arrays import Float, Int
from aatri.formats.tables.columns import COVARIANCES, SIGMAS
from aatri.formats.tables.source import Source, choice, look_up
from aatri.formats.text.csv_table import CsvTable
from aatri.formats.text.number_text import number_of
from aatri.frames.axes import columns_in_order

TABLES = ("geodetic", "ground_points")


def read_covariances(source: Source) -> CsvTable | None:
    """covariances.csv as it stands; the tables it speaks of are there."""
    table = source.table("covariances.csv")
    if table is None:
        return None
    named = choice(table, "table", TABLES, "")
    for name in TABLES:
        if name in named and not (source.folder / f"{name}.csv").exists():
            source.problems.add(
                f"there is no {name}.csv", table.where(named.index(name), "table"), "covariances are between its rows"
            )
    return table


def geodetic_covariances(source: Source, table: CsvTable | None, n: int, unit: Float) -> dict[str, Any]:
    """Covariances of geodetic observations, by rows of geodetic.csv; nothing where there are none, or faults.

    Parameters
    ----------
    n : int
        Rows of geodetic.csv.
    unit : (n,) float64
        Factor of each observation's value to m or rad.
    """
    chosen = _of(table, "geodetic")
    if table is None or not len(chosen):
        return {}
    before = len(source.problems)
    numbers = np.zeros((len(table), 2))
    for side, name in enumerate(("row_a", "row_b")):
        numbers[chosen, side] = [_number(table.text[name][k]) for k in chosen]
        stated = numbers[chosen, side]
        wrong = (stated % 1 != 0) | (stated < 1) | (stated > n)
        table.complain(
            chosen[wrong],
            name,
            f"{name} is {{}}, but geodetic.csv has rows 1 to {n}",
            "rows are counted from 1, without the header",
        )
        column = "coord" + name[3:]
        table.complain(
            [k for k in chosen if table.text[column][k]],
            column,
            f"{column} is {{}}, but a geodetic observation has one value",
            "leave it empty",
        )
    table.complain(
        chosen[numbers[chosen, 0] == numbers[chosen, 1]],
        "row_b",
        "a variance, not a covariance",
        "the variance is the square of sigma in geodetic.csv",
    )
    if len(source.problems) > before:
        return {}
    pair = np.sort(numbers[chosen].astype(np.intp) - 1, axis=1)
    _refuse_repeats(table, chosen, pair)
    value = table.number["value"][chosen] * (unit[pair[:, 0]] * unit[pair[:, 1]])
    return {"row_a": pair[:, 0], "row_b": pair[:, 1], "value": value}


def with_own_covariances(table: CsvTable, covariances: CsvTable | None) -> CsvTable:
    """ground_points.csv with the variances and covariances of single points that covariances.csv gives."""
    chosen = _of(covariances, "ground_points")
    if covariances is None or not len(chosen):
        return table
    number = {name: table.number[name].copy() for name in (*SIGMAS, *COVARIANCES)}
    row, axis = _places(covariances, table)
    names = {(k, k): name for k, name in enumerate(SIGMAS)} | {pair: name for name, pair in COVARIANCES.items()}
    of_points = (row >= 0).all(axis=1) & (axis >= 0).all(axis=1)
    for k in chosen[(of_points & (row[:, 0] == row[:, 1]))[chosen]].tolist():
        i, j = sorted(axis[k].tolist())
        cells, value = number[names[i, j]], float(covariances.number["value"][k])
        if np.isfinite(cells[row[k, 0]]):
            covariances.complain(
                [k],
                "value",
                f"covariance {{}}: the point has {names[i, j]} already",
                "give it once: here or in ground_points.csv",
            )
        elif i == j and value < 0:
            covariances.complain([k], "value", "variance {} is negative", "0 (exact) or more")
        else:
            cells[row[k, 0]] = np.sqrt(value) if i == j else value
    return dataclasses.replace(table, number=table.number | number)


def ground_point_covariances(
    source: Source,
    table: CsvTable,
    covariances: CsvTable | None,
    frame: Int,
    xyz_m: Float,
    covariance_m2: Float,
    derivatives: Float,
) -> dict[str, Any]:
    """Covariances between two points, by rows of ground_points.csv and right-handed axes; nothing where none are.

    Those along the axes of other frames are converted as the points are: C_ab = D_a C D_b'.

    Parameters
    ----------
    table : CsvTable
        ground_points.csv.
    frame : (n,) int
        Frame of each of its rows.
    xyz_m, covariance_m2, derivatives : (n, 3), (n, 3, 3), (n, 3, 3) float64
        Coordinates of its rows in right-handed axes of the first frame, their own covariances, and D.
    """
    chosen = _of(covariances, "ground_points")
    if covariances is None or not len(chosen):
        return {}
    before = len(source.problems)
    row, axis = _places(covariances, table)
    chosen = chosen[row[chosen, 0] != row[chosen, 1]]
    orders = np.array([np.argsort(columns_in_order(f.axes)) for f in source.settings.frames.values()])
    row = row[chosen]
    axis = orders[frame[row], axis[chosen]]
    variance = np.einsum("nii->ni", covariance_m2)
    for side, name in enumerate(("row_a", "row_b")):
        unknown = np.isnan(xyz_m[row[:, side], axis[:, side]])
        covariances.complain(chosen[unknown], name, f"{name} is {{}}, a point without this coordinate", "leave it out")
        exact = ~unknown & ~(variance[row[:, side], axis[:, side]] > 0)
        covariances.complain(
            chosen[exact],
            name,
            f"{name} is {{}}, a point whose coordinate is exact",
            "give it a standard deviation, or leave the covariance out",
        )
    if len(source.problems) > before:
        return {}
    _refuse_repeats(covariances, chosen, np.sort(3 * row + axis, axis=1))
    value = covariances.number["value"][chosen] * source.settings.units.sigma_ground_m**2
    row, axis, value = _in_the_first_frame(row, axis, value, frame, derivatives)
    return {"row_a": row[:, 0], "axis_a": axis[:, 0], "row_b": row[:, 1], "axis_b": axis[:, 1], "value": value}


def _in_the_first_frame(row: Int, axis: Int, value: Float, frame: Int, derivatives: Float) -> tuple[Int, Int, Float]:
    """Covariances of two coordinates each, (k, 2) rows and axes: of points of other frames all nine of a pair."""
    other = (frame[row] > 0).any(axis=1)
    if not other.any():
        return row, axis, value
    turned = row[other, 0] > row[other, 1]
    pair_row, pair_axis = row[other], axis[other]
    pair_row[turned], pair_axis[turned] = pair_row[turned][:, ::-1], pair_axis[turned][:, ::-1]
    pairs, of_pair = np.unique(pair_row, axis=0, return_inverse=True)
    C = np.zeros((len(pairs), 3, 3))
    C[of_pair.ravel(), pair_axis[:, 0], pair_axis[:, 1]] = value[other]
    C = derivatives[pairs[:, 0]] @ C @ derivatives[pairs[:, 1]].transpose(0, 2, 1)
    axes = np.stack(np.meshgrid(range(3), range(3), indexing="ij"), axis=-1).reshape(9, 2)
    correlated = C.ravel() != 0  # a coordinate that is exact in both frames has none
    return (
        np.concatenate([row[~other], np.repeat(pairs, 9, axis=0)[correlated]]),
        np.concatenate([axis[~other], np.tile(axes, (len(pairs), 1))[correlated]]),
        np.concatenate([value[~other], C.ravel()[correlated]]),
    )


def _of(table: CsvTable | None, name: str) -> Int:
    """Rows that speak of a table."""
    return np.array([] if table is None else [k for k, cell in enumerate(table.text["table"]) if cell == name], np.intp)


def _places(covariances: CsvTable, table: CsvTable) -> tuple[Int, Int]:
    """(n, 2) row in ground_points.csv and number of the coordinate; -1 where they are faulty or of another table."""
    row_of = {name: k for k, name in enumerate(table.text["point"])}
    rows = _of(covariances, "ground_points")
    row, axis = np.full((len(covariances), 2), -1), np.full((len(covariances), 2), -1)
    for side in range(2):
        ids, coords = covariances.text["row_" + "ab"[side]], covariances.text["coord_" + "ab"[side]]
        row[rows, side] = [row_of.get(ids[k], -1) for k in rows]
        axis[rows, side] = [("X", "Y", "Z").index(coords[k]) if coords[k] in ("X", "Y", "Z") else -1 for k in rows]
    return row, axis


def check_places(covariances: CsvTable | None, table: CsvTable) -> None:
    """Faults of ids and coordinates in the rows of table ground_points."""
    rows = _of(covariances, "ground_points").tolist()
    if covariances is None or not rows:
        return
    row_of = {name: k for k, name in enumerate(table.text["point"])}
    for side in "ab":
        ids = ["" for _ in range(len(covariances))]
        for k in rows:
            ids[k] = covariances.text[f"row_{side}"][k]
        part = dataclasses.replace(covariances, text={f"row_{side}": ids})
        look_up(part, f"row_{side}", row_of, "ground point", "it is the id of a point in ground_points.csv")
        cells = covariances.text[f"coord_{side}"]
        wrong = [k for k in rows if cells[k] not in ("X", "Y", "Z")]
        covariances.complain(wrong, f"coord_{side}", f"coord_{side} is {{}}", "it is X, Y or Z")


def _number(text: str) -> float:
    try:
        return number_of(text)
    except ValueError:
        return np.nan


def _refuse_repeats(table: CsvTable, chosen: Int, pair: Int) -> None:
    """A fault for each pair that is given twice."""
    first = np.lexsort((pair[:, 1], pair[:, 0]))
    twice = np.flatnonzero((np.diff(pair[first], axis=0) == 0).all(axis=1))
    table.complain(chosen[first[twice + 1]], "row_a", "this pair of rows is given twice", "remove one")
