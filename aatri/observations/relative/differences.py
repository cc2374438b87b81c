"""Equal distances, and differences of one coordinate between two points.

    equal_distance         v = |B - A| - l,        l the common length, an unknown
    coordinate_difference  v = X_B - X_A - value,  X one coordinate of the block's first frame

Source: docs/formulas.md 5.5.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int
from aatri.notes import Note
from aatri.observations.geodetic.lengths import slope
from aatri.observations.observed import NEARLY_EXACT, Given, Observed, named
from aatri.observations.poses import POINT
from aatri.observations.relative.members import conditions, members_of
from aatri.observations.relative.shapes import NOTHING, means, seeing

EQUAL, DIFFERENCE = "equal_distance", "relative_difference"

USES = ("relative_control:equal_distance", "relative_control:coordinate_difference")


def relative_differences(given: Given) -> tuple[Observed, ...]:
    """Equal distances and coordinate differences of the relative control."""
    found: list[Observed] = []
    control = given.block.relative_control
    for exact in (False, True):
        row = conditions(given.block, "equal_distance")
        row = row[(control.sigma[row] == 0) == exact]
        if len(row):
            found.append(_equal(given, row, exact))
        row = conditions(given.block, "coordinate_difference")
        row = row[(control.sigma[row] == 0) == exact]
        if len(row):
            found.append(_difference(given, row, exact))
    return tuple(found)


def _equal(given: Given, row: Int, exact: bool) -> Observed:
    block = given.block
    members = [members_of(block, int(k)) for k in row]
    pairs = np.concatenate([m[0].reshape(-1, 2) for m in members]).astype(np.int32)
    ids = np.concatenate([m[1].reshape(-1, 2) for m in members])
    of = np.repeat(np.arange(len(row)), [len(m[0]) // 2 for m in members]).astype(np.int32)
    group = f"exact_{EQUAL}" if exact else EQUAL

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        x = state[POINT]
        length, u = slope(x[pairs[some, 1]] - x[pairs[some, 0]])
        v = length - state[group][of[some], 0]
        return v[:, None], (-u[:, None, :], u[:, None, :], -np.ones((len(some), 1, 1)))

    def generator(state: State) -> Float:
        found = np.zeros((len(row), 1, 7))
        found[:, 0, 6] = state[group][:, 0]
        return found

    x = given.start[POINT]
    length = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    known = np.flatnonzero(np.isfinite(length))
    start = means(length[known, None], of[known], len(row))
    sigma = block.relative_control.sigma[row][of]
    touches = ((POINT, pairs[:, 0]), (POINT, pairs[:, 1]), (group, of))
    records = Records(
        EQUAL,
        touches,
        evaluate,
        1.0 / np.where(sigma > 0, sigma, NEARLY_EXACT)[:, None],
        np.ones(len(of), dtype=bool),
        similarity=seeing(NOTHING),
    )
    labels = np.array([" ".join(m[1].tolist()[:4]) for m in members], dtype=np.str_)
    unknowns = Unknowns(group, np.ones((len(row), 1), dtype=bool), ("length",), labels, add_step, generator=generator)
    text = f"{EQUAL}: {len(row)} conditions {'exact' if exact else 'observed'}, redundancy gained {len(of) - len(row)}"
    names = np.array([f"{a}-{b}" for a, b in ids], dtype=np.str_)
    member = np.flatnonzero(np.isin(block.relative_control_members.condition, row))[::2]
    return Observed(
        records,
        member,
        named(point=names),
        "m",
        unknowns=(unknowns,),
        start={group: start},
        exact=exact,
        refitted=lambda start: _equal(replace(given, start=start), row, exact),
        notes=(Note("note", text, tuple(labels.tolist())),),
    )


def _difference(given: Given, row: Int, exact: bool) -> Observed:
    control, level = given.block.relative_control, given.level
    members = [members_of(given.block, int(k)) for k in row]
    ends = np.array([m[0] for m in members]).astype(np.int32)
    axis = np.array(["XYZ".index(a) for a in control.axis[row].tolist()])
    value, sigma = control.value[row], control.sigma[row]

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        k, n = axis[some], np.arange(len(some))
        (low, by_low), (high, by_high) = (level.coordinates(state[POINT][ends[some, i]]) for i in range(2))
        v = (high - low)[n, k] - value[some]
        return v[:, None], (-by_low[n, k][:, None, :], by_high[n, k][:, None, :])

    names = np.array(["-".join(m[1].tolist()) for m in members], dtype=np.str_)
    whitener = 1.0 / np.where(sigma > 0, sigma, NEARLY_EXACT)[:, None]
    touches = ((POINT, ends[:, 0]), (POINT, ends[:, 1]))
    records = Records(DIFFERENCE, touches, evaluate, whitener, np.ones(len(row), dtype=bool))
    sees = np.arange(3) == axis[:, None]
    return Observed(
        records, row, named(point=names), "m", exact=exact, sees=np.ones_like(sees) if level.curved else sees
    )
