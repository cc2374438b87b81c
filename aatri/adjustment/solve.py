"""Non-linear least squares of large problems: Gauss-Newton with Levenberg-Marquardt fall-back on the reduced equations.

Converged when the Newton decrement sqrt(-g'dx) of an undamped step is at most `tolerance`, which bounds the step of
every unknown by `tolerance` times its own standard deviation; the step is applied. A step that raises the cost, or that
a veto refuses (a point changes its side of the camera), is repeated with damping. What does not converge is a failure,
not a result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.adjustment.damping import Damping, gain
from aatri.adjustment.dense import RANK_TOLERANCE
from aatri.adjustment.factor import Factor, factorise
from aatri.adjustment.normal import Layout, NormalEquations, back_substitute, cost_of, form, layout_of
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, retract_state
from aatri.errors import ConvergenceError, GeometryError
from aatri.progress import SILENT, Reporter

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    """One line of the history."""

    cost: float
    decrement: float
    damping: float


@dataclass(frozen=True)
class Adjusted:
    """A converged adjustment.

    Attributes
    ----------
    state : dict
        Adjusted values of all groups.
    unknowns, records
        The problem.
    layout : Layout
    normal : NormalEquations
        Undamped normal equations at the solution.
    factor : Factor
        Factor of the reduced matrix there.
    cost : float
        v'v at the solution.
    observations, n_unknowns, redundancy : int
    sigma0 : float
        sqrt(v'v / redundancy), NaN without redundancy.
    history : tuple of Step
    """

    state: dict[str, Any]
    unknowns: tuple[Unknowns, ...]
    records: tuple[Records, ...]
    layout: Layout
    normal: NormalEquations
    factor: Factor
    cost: float
    observations: int
    n_unknowns: int
    redundancy: int
    sigma0: float
    history: tuple[Step, ...]


Veto = Callable[[State, State], str]
"""(old, new) -> why the new state is refused, or an empty text."""


def adjust_large(
    unknowns: Sequence[Unknowns],
    records: Sequence[Records],
    start: State,
    *,
    max_iterations: int = 30,
    tolerance: float = 1e-3,
    veto: Veto | None = None,
    reporter: Reporter = SILENT,
) -> Adjusted:
    """Adjust a problem of any size.

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge; the message names the worst records.
    """
    layout = layout_of(unknowns)
    state: dict[str, Any] = dict(start)
    history: list[Step] = []
    damping, converged = Damping(), False
    for iteration in range(1, max_iterations + 1):
        normal = form(records, layout, state, damping.value)
        if not np.isfinite(normal.cost):
            raise ConvergenceError(f"residuals are not finite in iteration {iteration}", remedy=_ADVICE)
        steps, decrement, predicted = _step(unknowns, layout, normal, damping.value)
        trial = retract_state(unknowns, state, steps)
        cost = cost_of(records, trial)
        refused = (veto(state, trial) if veto else "") or _worse(cost, normal.cost)
        history.append(Step(normal.cost, decrement, damping.value))
        reporter.log(
            f"iteration {iteration}: cost {normal.cost:.6f}, decrement {decrement:.3g}, damping {damping.value:.1g}"
        )
        converged = damping.value == 0.0 and decrement <= tolerance
        if converged or not refused:
            state = trial
            damping = damping.accepted(gain(normal.cost, cost, predicted))
        else:
            reporter.log(f"iteration {iteration}: step refused: {refused}")
            damping = damping.refused()
        if converged:
            break
    if not converged:
        raise ConvergenceError(_failure(records, state, max_iterations, history[-1]), remedy=_ADVICE)
    return finished(unknowns, records, state, tuple(history))


def finished(
    unknowns: Sequence[Unknowns], records: Sequence[Records], state: dict[str, Any], history: tuple[Step, ...]
) -> Adjusted:
    """Statistics of a solution that has been found."""
    layout = layout_of(unknowns)
    normal = form(records, layout, state)
    factor = _factor(unknowns, layout, normal)
    observations = sum(r.observations for r in records)
    n_unknowns = sum(int(u.free.sum()) for u in unknowns)
    redundancy = observations - n_unknowns
    sigma0 = float(np.sqrt(normal.cost / redundancy)) if redundancy > 0 else float("nan")
    return Adjusted(state, tuple(unknowns), tuple(records), layout, normal, factor, normal.cost,
                    observations, n_unknowns, redundancy, sigma0, history)  # fmt: skip


_ADVICE = "check the worst observations, or start from better initial values (`from: initial`)"


def _worse(trial: float, cost: float) -> str:
    if not np.isfinite(trial):
        return "residuals are not finite"
    return f"cost rises from {cost:.6g} to {trial:.6g}" if trial > cost * (1 + 1e-10) + 1e-10 else ""


def _step(
    unknowns: Sequence[Unknowns], layout: Layout, normal: NormalEquations, damping: float
) -> tuple[dict[str, Float], float, float]:
    """Steps of all groups, the Newton decrement, and the decrease of the cost that the linear model predicts."""
    if damping == 0.0:
        check_eliminated(unknowns, normal)
    dx = _factor(unknowns, layout, normal).solve(normal.right)
    dy = back_substitute(normal, dx)
    steps: dict[str, Float] = {}
    for u in unknowns:
        if u.eliminated:
            steps[u.name] = np.where(u.free, dy, 0.0)
        else:
            columns = layout.kept[u.name]
            steps[u.name] = np.where(columns >= 0, np.append(dx, 0.0)[columns], 0.0)
    slope = float(normal.gradient_kept @ dx + (normal.gradient_eliminated * dy).sum())
    # with (N + lambda diag N) s = -g the model's decrease of v'v is -g's + lambda s' diag(N) s
    held = float(normal.diagonal_kept @ dx**2 + (normal.diagonal_eliminated * dy**2).sum())
    return steps, float(np.sqrt(max(-slope, 0.0))), -slope + damping * held


def check_eliminated(unknowns: Sequence[Unknowns], normal: NormalEquations) -> None:
    """Refuse eliminated blocks that their own observations do not determine, by name."""
    weak = np.flatnonzero(normal.D_lowest < RANK_TOLERANCE)
    if len(weak):
        group = next(u for u in unknowns if u.eliminated)
        shown = ", ".join(f"{group.name} {group.ids[k]}" for k in weak[:10])
        more = f" and {len(weak) - 10} more" if len(weak) > 10 else ""
        raise GeometryError(
            f"{len(weak)} of {len(group.ids)} are not determined by their observations: {shown}{more}",
            remedy="give them more rays or known coordinates, or leave them out",
        )


def _factor(unknowns: Sequence[Unknowns], layout: Layout, normal: NormalEquations) -> Factor:
    def name_of(column: int) -> str:
        for u in unknowns:
            if not u.eliminated:
                found = np.argwhere(layout.kept[u.name] == column)
                if len(found):
                    return u.label(int(found[0][0]), int(found[0][1]))
        return f"unknown {column}"

    return factorise(normal.reduced, name_of)


def _failure(records: Sequence[Records], state: State, iterations: int, last: Step) -> str:
    worst = []
    for r in records:
        v = r.residuals(state)
        size = np.abs(np.einsum("nij,nj->ni", r.whitener, v)).max(axis=1) * r.active
        worst += [(float(size[k]), f"{r.name} row {k}: {size[k]:.1f} sigma") for k in np.argsort(-size)[:5]]
    listed = "; ".join(text for _, text in sorted(worst, reverse=True)[:5])
    return f"no convergence in {iterations} iterations (decrement {last.decrement:.3g}); largest residuals: {listed}"
