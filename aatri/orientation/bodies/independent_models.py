"""Block adjustment with independent models: seven parameters per model, all models to the ground at once.

Points of the models, their perspective centres and control are observations of unknown ground points (`model_ties`,
`observations.ties`); the ground points are eliminated. Gross errors are searched and re-admitted as in the strip block
(`adjusting.tied_adjustment`). What the models disagree beyond their standard deviations is estimated as tau.

plan_height: the classical iteration (PAT-M), plan with the height held and height with the plan held, in turn
(`plan_height`). The common adjustment follows, for statistics, and has nothing left to do.

Source: Ackermann, Ebner & Klein 1970, PAT-M; Ebner 1972; docs/formulas.md 4.5.
"""

from dataclasses import replace

from aatri.adjusting.tied_adjustment import TiedResult, adjust_tied, snooping_of
from aatri.adjusting.tied_problem import TiedProblem
from aatri.arrays import Bool
from aatri.observations.ties import BODY
from aatri.orientation.bodies.plan_height import plan_and_height


def adjust_models(
    problem: TiedProblem, *, limit: float | None, active: Bool, plan_height: bool = False
) -> tuple[TiedResult, int]:
    """Adjust all models together; and in how many rounds plan and height were adjusted before, in turn.

    Parameters
    ----------
    problem : TiedProblem
        Points and perspective centres of models, control and positions.
    limit : float, optional
        Test statistic of a wrong tie or control point; None: by the number of tests.
    active : (n,) bool
        Observations to begin with; the others are tested for re-admission.
    plan_height : bool
        Plan and height in turn.

    Raises
    ------
    GeometryError
        If something is not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    rounds = 0
    if plan_height:
        models, rounds = plan_and_height(problem, active)
        problem = replace(problem, start={**problem.start, BODY: models})
    return adjust_tied(problem, snooping_of(problem, limit), active=active), rounds
