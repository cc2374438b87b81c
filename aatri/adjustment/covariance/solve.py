"""One step of a linear or linearised problem, whose factor is kept for all that follows from it.

    index = prepare(unknowns, records)              all records, active or not, once
    solved = solve(index, state, weights)           one linearisation, one factorisation
    solved.state, solved.covariances, solved.tests()

For a linear problem the state after the step is the solution, and the factor that of any state. For one that is only
linearised, covariances and tests are those of the linearisation; `departure` says how far it is from being linear.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.covariance.dense import tests_of
from aatri.adjustment.covariance.marginal import Covariances, covariances_at
from aatri.adjustment.elimination.backsolve import steps
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.openness.set_aside import refuse_undetermined
from aatri.adjustment.openness.weighted_datum import is_singular
from aatri.adjustment.statistics.record_tests import RecordTests
from aatri.adjustment.stepping.linearity import after_step
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.weights import Weights, with_weights
from aatri.adjustment.unknowns import State, retract_state
from aatri.arrays import Float
from aatri.errors import ConvergenceError


@dataclass(frozen=True)
class LinearSolution:
    """A solved problem with its factor."""

    problem: IndexedProblem
    """With the weights it was solved with."""
    state: dict[str, Any]
    """After the step."""
    factored: Factored
    before: State
    """The state of the linearisation."""
    step: dict[str, Float]
    """Dict of str to (n, k). Of every group, from there."""

    @cached_property
    def departure(self) -> float:
        """Largest difference of a residual from the linear model, in its standard deviations."""
        if all(r.linear for r in self.problem.records):
            return 0.0
        return after_step(self.problem, self.before, self.state, self.step)[0]

    @cached_property
    def covariances(self) -> Covariances:
        """Marginal covariances, a priori."""
        return covariances_at(self.problem, self.state, self.factored, residuals=True)

    def tests(self) -> dict[str, RecordTests]:
        """Tests of all records by key of their type, predicted where not active; constraints are not tested."""
        return tests_of(self.problem.observed, self.state, self.covariances)


def solve(problem: IndexedProblem, state: State, weights: Mapping[str, Weights] | None = None) -> LinearSolution:
    """Take one undamped step from a state.

    Parameters
    ----------
    problem : IndexedProblem
        Made by `prepare`.
    state : mapping
        Where to linearise; for a linear problem any.
    weights : mapping, optional
        Other weights of some observation types, by key.

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If residuals are not finite.
    """
    problem = with_weights(problem, weights) if weights else problem
    factored = factorise_constrained(problem, state)
    if not np.isfinite(factored.cost):
        raise ConvergenceError("residuals are not finite", remedy="check the observations and the initial values")
    if is_singular(problem, state, factored):
        refuse_undetermined(problem, state, factored)
    step = steps(problem, factored, state)
    after = retract_state(problem.unknowns, state, step)
    return LinearSolution(problem, after, factored, state, step)
