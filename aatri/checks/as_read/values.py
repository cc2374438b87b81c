"""Ids, sizes of numbers, standard deviations and covariances that no file may give, whatever its format.

Seen: weights that are no numbers, points that cannot be named, matrices that no adjustment can invert.
Test:

- ids and names: at most 255 bytes of UTF-8, no control characters and line ends, no outer blanks; distinct where a row
  is what the id names
- numbers: at most 1e100, so that squares and products are still numbers
- standard deviations: not negative, of measurements more than 0; what is more than 0 lies between 1e-15 (m: the size of
  an atomic nucleus) and 1e12 (m: beyond Jupiter) in the units of the Block, so that weights 1/s^2 are numbers
- covariances: every set of correlated figures has a positive definite matrix; exact ones (variance 0) have none

Readers keep the faults that only they can place better, such as the cell of a CSV file.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import TRUTH, Block, GroundPoints
from aatri.checks.finding import Finding
from aatri.checks.limits import LARGEST_SIGMA, LEAST_EIGENVALUE, MOST_LISTED, SMALLEST_SIGMA
from aatri.ids import OF_IDS, clipped, invalid
from aatri.tables.schema import Table, columns_of, tables_of
from aatri.units import LARGEST

MEASURED = ("image_points", "fiducial_points", "geodetic")
"""Tables of measurements: their standard deviations are more than 0."""
PATHS = ("files", "frames", "rejects")
"""Tables whose texts are no ids."""
NAMED_ONCE = {"cameras": "camera", "strips": "strip", "images": "image", "points": "point"}
"""Tables whose column `id` names the row, and what it is."""

NO_SIGMA = "not the standard deviation of a measurement"
OF_SIGMAS = "check its unit and exponent; leave out what is not measured, 0 is exact where it may be"


def wrong_values(block: Block) -> list[Finding]:
    """What no reader may let through, each fault with its file and line.

    Parameters
    ----------
    block : Block
        Right after reading, before anything is set aside.
    """
    faults: list[Finding] = []
    for name in tables_of(Block):
        rows = getattr(block, name)
        if rows is None or name in TRUTH or name in PATHS:
            continue
        for column, declared in columns_of(type(rows)).items():
            values = getattr(rows, column)
            if declared.dtype == "str":
                faults += _faults_of_names(block, name, column)
            elif declared.dtype == "f8":
                faults += _faults_of_numbers(block, name, column, values)
    return faults or [*_faults_of_points(block), *_faults_of_sets(block)]


def _faults_of_names(block: Block, name: str, column: str) -> Iterator[Finding]:
    """Texts that are no ids, and ids that stand twice."""
    values: list[str] = getattr(getattr(block, name), column).tolist()
    distinct = set(values)
    for text in sorted(invalid(distinct - {""}))[:MOST_LISTED]:
        what = f"{clipped(text)!r} is no id or name"
        yield _error(what, where=_place(block, name, values.index(text)), remedy=OF_IDS)
    if name in NAMED_ONCE and column == "id" and (len(distinct) < len(values) or "" in distinct):
        twice = [text for text, count in Counter(values).items() if count > 1 or not text]
        for text in twice[:MOST_LISTED]:
            what = f"{NAMED_ONCE[name]} {clipped(text)!r} twice" if text else f"a {NAMED_ONCE[name]} without an id"
            yield Finding(
                "values",
                "error",
                what,
                where=_place(block, name, values.index(text)),
                remedy="give each an id of its own",
            )


def _faults_of_numbers(block: Block, name: str, column: str, values: Float) -> Iterator[Finding]:
    """Numbers too large, and standard deviations out of bounds."""
    per_row = values.reshape(len(values), int(np.prod(values.shape[1:])))
    size = np.abs(per_row)
    yield from _of_rows(
        block, name, column, per_row, size > LARGEST, "too large for a quantity", "check unit and digits"
    )
    if "sigma" not in column:
        return
    low = (per_row < 0) | ((per_row == 0) & (name in MEASURED))
    least = "more than 0" if name in MEASURED else "0 (exact) or more"
    yield from _of_rows(block, name, column, per_row, low, "out of bounds", f"a standard deviation is {least}")
    yield from _of_rows(block, name, column, per_row, _no_sigma(per_row), NO_SIGMA, OF_SIGMAS)


def _no_sigma(sigma: Float) -> Bool:
    return np.asarray((sigma > 0) & ((sigma < SMALLEST_SIGMA) | (sigma > LARGEST_SIGMA)))


def _of_rows(
    block: Block, name: str, column: str, values: Float, wrong: Bool, what: str, remedy: str
) -> Iterator[Finding]:
    """An error for each of the rows that have wrong values, with the first of them."""
    for row in np.flatnonzero(wrong.any(axis=1))[:MOST_LISTED].tolist():
        value = values[row][wrong[row]][0]
        yield _error(f"{name}.{column} is {value:g}, {what}", where=_place(block, name, row), remedy=remedy)


def _faults_of_points(block: Block) -> Iterator[Finding]:
    """Covariances of single positions."""
    for name, column in (("ground_points", "covariance_m2"), ("exterior", "position_covariance_m2")):
        matrix = getattr(getattr(block, name), column)
        complete = np.isfinite(matrix).all(axis=(1, 2))
        wrong = np.zeros(len(matrix), dtype=bool)
        wrong[complete] = ~_definite(matrix[complete])
        sigma = np.sqrt(np.maximum(np.nan_to_num(matrix[:, range(3), range(3)]), 0.0))
        odd = _no_sigma(sigma)
        yield from _of_rows(block, name, "sigma", sigma, odd, NO_SIGMA, OF_SIGMAS)
        for row in np.flatnonzero(wrong & ~odd.any(axis=1))[:MOST_LISTED].tolist():
            remedy = "sXY, sXZ, sYZ are covariances, not standard deviations or correlations"
            what = "sX ... sYZ form no covariance matrix: it has a negative eigenvalue, or one of 0"
            yield _error(what, where=_place(block, name, row), remedy=remedy)


def _definite(matrices: Float) -> Bool:
    """Whether each matrix (n, d, d) is positive definite among the figures whose variance is not 0."""
    variance = np.einsum("nii->ni", matrices)
    scale = np.sqrt(np.maximum(variance, 0.0))
    exact = scale == 0.0
    scale[exact] = 1.0
    correlation = matrices / (scale[:, :, None] * scale[:, None, :])
    exact_free = ~((exact[:, :, None] | exact[:, None, :]) & (matrices != 0)).any(axis=(1, 2))
    correlation[:, range(matrices.shape[1]), range(matrices.shape[1])] = 1.0
    return np.asarray(exact_free & (np.linalg.eigvalsh(correlation)[:, 0] > LEAST_EIGENVALUE))


def _faults_of_sets(block: Block) -> Iterator[Finding]:
    """Sets of correlated observations, and of correlated coordinates of several points."""
    geodetic, of_geodetic = block.geodetic, block.geodetic_covariances
    pair = np.stack([of_geodetic.row_a, of_geodetic.row_b], axis=1)
    for rows in _indefinite_sets(geodetic.sigma**2, pair, of_geodetic.value):
        names = [geodetic.called(k) for k in rows]
        yield _indefinite(_place(block, "geodetic", int(rows[0])), names)
    ground, between = block.ground_points, block.ground_point_covariances
    if not len(between):
        return
    ends = (3 * between.row_a + between.axis_a, 3 * between.row_b + between.axis_b)
    variance, pair, value = _coordinates(ground, np.stack(ends, axis=1), between.value)
    for rows in _indefinite_sets(variance, pair, value):
        names = [f"{'XYZ'[k % 3]} of {block.points.id[ground.point[k // 3]]}" for k in rows.tolist()]
        yield _indefinite(_place(block, "ground_points", int(rows[0]) // 3), names)


def _indefinite(where: str, names: list[str]) -> Finding:
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    what = f"the covariance matrix of {', '.join(map(clipped, names[:MOST_LISTED]))}{more} is not positive definite"
    return _error(what, where=where, remedy="a covariance is smaller than the product of its two sigmas")


def _coordinates(ground: GroundPoints, pair: Int, value: Float) -> tuple[Float, Int, Float]:
    """Variances of all coordinates of ground points, and their covariances: those given and those of one point.

    Parameters
    ----------
    pair : (m, 2) int
        Coordinates, 3 * row + axis, of two points each.
    value : (m,) float64, m^2
    """
    own = np.nan_to_num(ground.covariance_m2)
    point, i, j = (index.ravel() for index in np.indices(own.shape))
    inside = (i < j) & (own.ravel() != 0)
    within = np.stack([3 * point[inside] + i[inside], 3 * point[inside] + j[inside]], axis=1)
    variance = np.einsum("nii->ni", own).ravel()
    return variance, np.concatenate([pair, within]), np.concatenate([value, own.ravel()[inside]])


def _indefinite_sets(variance: Float, pair: Int, value: Float) -> Iterator[Int]:
    """The rows of each set of correlated figures whose covariance matrix is not positive definite.

    Parameters
    ----------
    variance : (n,) float64
    pair : (m, 2) int
        Rows of two figures each.
    value : (m,) float64
        Their covariances.
    """
    n = len(variance)
    if not len(pair):
        return
    _, label = connected_components(coo_array((np.ones(len(pair)), pair.T), shape=(n, n)), directed=False)
    for group in np.unique(label[pair[:, 0]]).tolist():
        rows = np.flatnonzero(label == group)
        place = np.cumsum(label == group) - 1
        matrix = np.diag(variance[rows])
        inside = label[pair[:, 0]] == group
        a, b = place[pair[inside]].T
        matrix[a, b] = matrix[b, a] = value[inside]
        if not _definite(matrix[None])[0]:
            yield rows


def _place(block: Block, name: str, row: int) -> str:
    """`file:line` of a row; of the first row that names it, where the table has no lines of its own."""
    table: Any = getattr(block, name)
    if hasattr(table, "line"):
        return block.read_at(table, row) or _called(name, table, row)
    refers = {
        "points": (("image_points", "point"), ("ground_points", "point")),
        "strips": (("images", "strip"),),
        "cameras": (("images", "camera"),),
    }
    for user, column in refers.get(name, ()):
        rows = getattr(block, user)
        naming = np.flatnonzero(getattr(rows, column) == row)
        if len(naming):
            first = naming[np.argmin(rows.line[naming])]
            return block.read_at(rows, int(first))
    return _called(name, table, row)


def _called(name: str, table: Table, row: int) -> str:
    """What a row without a line is called."""
    ids: Any = getattr(table, "id", None)
    return f"{name} {row + 1 if ids is None else clipped(str(ids[row]))}"


def _error(text: str, *, where: str, remedy: str) -> Finding:
    return Finding("values", "error", text, remedy, where=where)
