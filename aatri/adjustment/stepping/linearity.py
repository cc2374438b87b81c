"""Linearisation test of the last step s: the residuals that the linear model foretells, v + J s, against the new ones.

The two ways to the adjusted observations must agree, otherwise one more step is due. Observations of blocks without
finite optimum are left out. Under a loss, whose weights change with the step, there is no test.

Source: Cepek, GNU Gama, the test of the linearisation.
"""

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.elimination.backsolve import cost_of
from aatri.adjustment.elimination.chunks import linearised
from aatri.adjustment.elimination.schedule import Stretch, in_parallel, stretches
from aatri.adjustment.kernels.linearity import largest_departure
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int

LINEAR = 1e-6
"""Most that an adjusted observation may depart from the linear model, in its standard deviations."""


def after_step(problem: IndexedProblem, old: State, new: State, step: dict[str, Float]) -> tuple[float, float]:
    """Largest departure of a residual from the linear model, in its standard deviations, and the cost of the new state.

    Parameters
    ----------
    old, new : mapping
        States before and after the step.
    step : dict of str to (n, k) float64
        Step of every group.
    """
    if any(records.loss is not None for records in problem.records):
        return 0.0, cost_of(problem, new)
    of_records = [_of_records(records, rows, old, new, step) for records, rows in problem.beside_rays]
    if problem.rays is not None:
        of_records.append(_of_rays(problem, old, new, step))
    largest, cost = max((departure for departure, _ in of_records), default=0.0), sum(cost for _, cost in of_records)
    others = problem.settings.others
    return (largest, cost) if others is None else (others.largest(largest), others.total(cost))


def _of_records(records: Records, rows: Int, old: State, new: State, step: dict[str, Float]) -> tuple[float, float]:
    v, jacobians = whitened(records, old, rows)
    for J, (group, blocks) in zip(jacobians, records.touches):
        v = v + np.einsum("nij,nj->ni", J, step[group][blocks[rows]])
    after = whitened(records, new, rows)[0]
    return float(np.abs(v - after).max(initial=0.0)), float((after**2).sum())


def _of_rays(problem: IndexedProblem, old: State, new: State, step: dict[str, Float]) -> tuple[float, float]:
    rays, column = problem.rays, problem.ray_columns
    assert rays is not None
    dx = np.zeros(problem.layout.n_kept)
    for u in problem.unknowns:
        if u.name != problem.layout.eliminated:
            columns = problem.layout.columns(u.name, u.size)
            dx[columns[columns >= 0]] = step[u.name][columns >= 0]
    dy = np.ascontiguousarray(step[problem.layout.eliminated][rays.block])
    runaway = problem.hold[:, 0, 0] > 0
    before, after = problem.ray_lane(old), problem.ray_lane(new)
    count = len(stretches(problem))
    largest, cost = np.zeros(count), np.zeros(count)

    def one(parts: Sequence[Stretch]) -> None:
        for stretch in parts:
            k = stretch.number
            for (p0, p1, v, A, B), (_, _, v_after, _, _) in zip(
                linearised(problem, before, stretch, masked=False), linearised(problem, after, stretch, masked=False)
            ):  # the step is zero where an unknown is held
                base, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
                places = (column[base:last], rays.parts.size, rays.parts.start)
                departure = largest_departure(p0, p1, base, rays.ray_start, v, A, B, *places, dx, dy, v_after, runaway)
                largest[k] = np.fmax(largest[k], departure) if np.isfinite(departure) else np.inf
                cost[k] += float((v_after**2).sum())

    in_parallel(problem, one)
    return float(largest.max(initial=0.0)), float(cost.sum())
