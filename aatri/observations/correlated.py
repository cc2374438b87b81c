"""Observations with full covariances: rows that covariances join become one record.

    v = (v_1 ... v_m),    covariance C of the m rows:  baselines, sessions of several baselines, control of a network

Sets of rows of the same build (as many rows of the same parts, between blocks that coincide in the same way) are the
records of one `Observed`, so that a thousand baselines are evaluated at once. A record is tested, and rejected, as a
whole; one of several kinds is of the kind `correlated`. What is exact has no covariance. Source: docs/formulas.md 5.4.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.observations.observed import Observed, named

COORDINATES = ("X", "Y", "Z")
MIXED = "correlated"
"""Kind of observations of different kinds that are correlated."""

Member = tuple[int, int]
"""Which of the observations, and which row of it."""


def joined(
    observed: Sequence[Observed], row_a: Int, row_b: Int, covariance: Float, scalar: Sequence[Int]
) -> tuple[Observed, ...]:
    """The observations with those that are correlated joined to records.

    Parameters
    ----------
    observed : sequence of Observed
        Of one table of the Block.
    row_a, row_b : (n,) int
        Numbers of the scalars that the covariances join.
    covariance : (n,) float64
    scalar : sequence of (n, m) int
        For each of the observations the numbers of its scalars.

    Raises
    ------
    InputError
        If a coordinate that is exact is correlated.
    """
    place = {int(k): (i, r) for i, numbers in enumerate(scalar) for r, row in enumerate(numbers) for k in row}
    used = np.array([int(a) in place and int(b) in place for a, b in zip(row_a, row_b)], dtype=bool) & (row_a != row_b)
    if not used.any():
        return tuple(observed)
    row_a, row_b, covariance = row_a[used], row_b[used], covariance[used]
    sets = _sets([place[int(k)] for k in row_a], [place[int(k)] for k in row_b])
    builds: dict[tuple[object, ...], list[list[Member]]] = defaultdict(list)
    for members in sets:
        for i, r in members:
            holds = observed[i].holds
            if holds is not None and holds.scalar[r].any():
                raise InputError(
                    "a coordinate is exact, others of the same point are correlated with other points",
                    where=observed[i].label(r),
                    remedy="give it a small standard deviation",
                )
        builds[_build(observed, members)].append(members)
    value = {(min(a, b), max(a, b)): c for a, b, c in zip(row_a.tolist(), row_b.tolist(), covariance.tolist())}
    uncorrelated = [np.ones(len(o), dtype=bool) for o in observed]
    for members in sets:
        for i, r in members:
            uncorrelated[i][r] = False
    records = [o if keep.all() else o.take(np.flatnonzero(keep)) for o, keep in zip(observed, uncorrelated)]
    records += [_joined(observed, of_build, value, scalar) for of_build in builds.values()]
    return tuple(o for o in records if len(o) or o.unknowns)


def _sets(a: list[Member], b: list[Member]) -> list[list[Member]]:
    """Connected sets of rows."""
    members = sorted({*a, *b})
    number = {m: k for k, m in enumerate(members)}
    pairs = coo_array(
        (np.ones(len(a)), ([number[m] for m in a], [number[m] for m in b])), shape=(len(members), len(members))
    )
    _, label = connected_components(pairs, directed=False)
    order = np.argsort(label, kind="stable")
    return [[members[k] for k in part] for part in np.split(order, np.flatnonzero(np.diff(label[order])) + 1)]


def _blocks(observed: Sequence[Observed], members: list[Member]) -> list[tuple[str, int]]:
    """What the rows of a set touch, each block once."""
    touched = [(group, int(block[r])) for i, r in members for group, block in observed[i].records.touches]
    return list(dict.fromkeys(touched))


def _build(observed: Sequence[Observed], members: list[Member]) -> tuple[object, ...]:
    """Of which parts a set is made, and which of its rows touch the same."""
    number = {block: k for k, block in enumerate(_blocks(observed, members))}
    return tuple(
        (i, *((group, number[group, int(block[r])]) for group, block in observed[i].records.touches))
        for i, r in members
    )


def _joined(
    observed: Sequence[Observed], sets: list[list[Member]], value: dict[tuple[int, int], float], scalar: Sequence[Int]
) -> Observed:
    """Sets of the same build as records of one kind."""
    parts = [observed[i] for i, _ in sets[0]]
    rows = np.array([[r for _, r in members] for members in sets])
    blocks = [_blocks(observed, members) for members in sets]
    touches = tuple(
        (group, np.array([b[k][1] for b in blocks], dtype=np.int32)) for k, (group, _) in enumerate(blocks[0])
    )
    place = {block: k for k, block in enumerate(blocks[0])}
    at = [
        [place[group, int(block[sets[0][j][1]])] for group, block in part.records.touches]
        for j, part in enumerate(parts)
    ]
    first = np.cumsum([0, *(part.records.rows for part in parts)])
    m = int(first[-1])

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        v, J = np.zeros((len(chosen), m)), [np.zeros(0)] * len(touches)
        for j, part in enumerate(parts):
            own = slice(first[j], first[j + 1])
            v[:, own], jacobians = part.records.evaluate(state, rows[chosen, j])
            for k, d in zip(at[j], jacobians):
                if not J[k].size:
                    J[k] = np.zeros((len(chosen), m, d.shape[2]))
                J[k][:, own] = d
        return v, tuple(J)

    numbers = np.array([np.concatenate([scalar[i][r] for i, r in members]) for members in sets])
    sigma = np.concatenate([part.records.sigmas()[rows[:, j]] for j, part in enumerate(parts)], axis=1)
    C = np.nan_to_num(sigma)[:, :, None] ** 2 * np.eye(m)
    _own_covariances(C, parts, rows, first)
    for k, of_set in enumerate(numbers.tolist()):
        for i in range(m):
            for j in range(i):
                c = value.get((min(of_set[i], of_set[j]), max(of_set[i], of_set[j])))
                if c is not None:
                    C[k, i, j] = C[k, j, i] = c
    mixed = len({part.kind for part in parts}) > 1
    whitener = whitener_of_covariances(C, np.isfinite(sigma))
    active = np.all([part.records.active[rows[:, j]] for j, part in enumerate(parts)], axis=0)
    records = Records(MIXED if mixed else parts[0].kind, touches, evaluate, whitener, active)
    labels = [_scalar_names(part, int(rows[0, j])) for j, part in enumerate(parts)]
    names = np.array(
        [_set_name([parts[j].label(int(r)) for j, r in enumerate(members)]) for members in rows], dtype=np.str_
    )
    # a set of more than three scalars is told scalar by scalar; of such a build there may be several sets
    if mixed:
        labels = [[f"{part.kind} {name}" for name in names] for part, names in zip(parts, labels)]
    components = tuple(name for names_of in labels for name in names_of) if mixed or m > 3 else ()
    units = tuple(part.unit for part in parts for _ in range(part.records.rows)) if mixed else ()
    sees = np.any([np.broadcast_to(part.sees, (len(part), 3))[rows[:, j]] for j, part in enumerate(parts)], axis=0)
    table_rows = np.array([part.row[rows[:, j]] for j, part in enumerate(parts)]).T
    row = table_rows.min(axis=1)
    unit = " or ".join(dict.fromkeys(units)) if mixed else parts[0].unit
    set_rows = np.sort(table_rows, axis=1)
    return Observed(records, row, named(point=names), unit, components, sees=sees, units=units, set_rows=set_rows)


def _own_covariances(C: Float, parts: list[Observed], rows: Int, first: Int) -> None:
    """Covariances that a part of several components has itself."""
    for j, part in enumerate(parts):
        if part.records.whitener.ndim == 3:
            W, used = part.records.whitener[rows[:, j]], part.records.observed_components()[rows[:, j]]
            both = used[:, :, None] & used[:, None, :]
            L = np.linalg.inv(np.where(both, W, np.eye(W.shape[1])))
            own = slice(first[j], first[j + 1])
            C[:, own, own] = np.where(both, L @ L.swapaxes(1, 2), 0.0)


def _scalar_names(part: Observed, row: int) -> list[str]:
    name = part.label(row)
    return [name] if part.records.rows == 1 else [f"{name} {c}" for c in COORDINATES[: part.records.rows]]


def _set_name(labels: list[str]) -> str:
    """`A-B dX`, `A-B dY`: `A-B`; else the first and the last."""
    ends = list(dict.fromkeys(label.split(" ")[0] for label in labels))
    return ends[0] if len(ends) == 1 else f"{ends[0]}...{ends[-1]}"
