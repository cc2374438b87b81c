"""Congruence of two epochs: which points of two adjustments have moved, by their covariances.

    d = x2 - x1 = H t + B s + e,    C(d) = C1 + C2

All points are tested together; where they are not congruent, the point that explains most is taken out, until the rest
is. Each displacement comes with its covariance, its test, and the smallest one found with 80 %. The level is that of a
false alarm anywhere. Epochs with a free datum are laid on each other by a similarity of the points that have not moved;
with `datum: none` a movement of the whole object against its control is seen too.

Both solutions need the covariances between their points: `point_covariances: ["*"]` of bundle_adjustment/bundle.
Without `earlier`, points of one adjustment are compared whose ids differ by a mark: P7@1 and P7@2.

Source: Pelzer 1971; Niemeier 1981; Caspary 1987. See aatri/evaluation/congruence.py.
"""

from typing import Literal

import numpy as np

from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.evaluation.epoch_points import marked_epochs, solved_points
from aatri.evaluation.epochs import compared
from aatri.plugin import SILENT, Context, Field, Options, stage


class CongruenceOptions(Options):
    """Options of the comparison."""

    datum: Literal["auto", "none", "shift", "rigid", "similarity"] = Field(
        "auto",
        description="how one datum may have moved against the other; auto: similarity where a datum is free, else none",
    )
    level: float = Field(0.05, gt=0, lt=1, description="probability of a false alarm anywhere")
    sigma0: Literal["a_priori", "pooled"] = Field(
        "a_priori", description="standard deviations as given, or scaled by sigma0 of both adjustments"
    )
    marks: tuple[str, str] = Field(
        ("@1", "@2"), description="ends of the ids of earlier and later points, where one adjustment has both"
    )


@stage(version=1, uses=())
def congruence(
    solution: Solution,
    earlier: Solution | None = None,
    *,
    options: CongruenceOptions = CongruenceOptions(),
    context: Context = SILENT,
) -> Evaluation:
    """Compare two epochs.

    Raises
    ------
    InputError
        If covariances between points are missing, or the epochs have no point in common.
    GeometryError
        If the points do not determine the movement of the datum.
    """
    solutions = [solution] if earlier is None else [earlier, solution]
    free = any(s.datum is not None and len(s.datum) for s in solutions)
    datum = options.datum if options.datum != "auto" else ("similarity" if free else "none")
    if free and datum != "similarity":
        raise InputError(
            "a solution with a free datum has no place, direction and scale of its own to compare",
            where="options of epochs/congruence: datum",
            remedy="datum: similarity, or adjust both epochs with control",
        )
    squares = sum(s.remaining_sigma0**2 * s.counted_redundancy for s in solutions if np.isfinite(s.sigma0))
    degrees = sum(s.counted_redundancy for s in solutions if np.isfinite(s.sigma0))
    pooled = options.sigma0 == "pooled" and degrees > 0
    between = None
    if earlier is None:
        first, second, between = marked_epochs(solved_points(solution, "solution"), options.marks)
    else:
        first, second = solved_points(earlier, "earlier"), solved_points(solution, "solution")
    result, warnings = compared(
        first,
        second,
        datum,
        level=options.level,
        sigma0=float(np.sqrt(squares / degrees)) if pooled else 1.0,
        sigma0_degrees=float(degrees) if pooled else np.inf,
        between_m2=between,
    )
    for warning in warnings:
        context.warn(warning)
    context.log(result.verdict)
    return result
