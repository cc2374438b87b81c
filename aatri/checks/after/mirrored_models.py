"""Models given by coordinates of which one has an axis of the wrong sign, where its common points lie in a plane.

Seen: control that is rejected, a large sigma0, no convergence; points in a plane join a mirrored model as well as a
right one, so that joining notices nothing.
Test: the adjustment itself. Where it fails, its sigma0 is above what chance explains, or it rejects something, it is
made again with an axis of one model after the other reversed: a model is named with which it fits, and rejects less.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from aatri.adapters.strips.model_adjustment import ModelAdjustmentOptions, adjusted_given_models
from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.checks.finding import Finding
from aatri.checks.limits import MOST_MIRRORED
from aatri.errors import ConvergenceError, GeometryError
from aatri.ids import several

AXES = (0, 2)
"""X and Z are reversed on trial: any two differ by half a turn of the model, but only one leaves it upright."""


def mirrored_models(block: Block, options: ModelAdjustmentOptions, solution: Solution | None) -> list[Finding]:
    """A warning where the models fit with an axis of one of them reversed; `solution` is None where it failed."""
    before = np.inf if solution is None or not _fits(solution) else int(solution.suspects.staying_out.sum())
    coordinates = block.model_coordinates
    if before == 0 or coordinates is None or len(np.unique(coordinates.model)) > MOST_MIRRORED:
        return []
    fitting = list(_fitting_mirrored(block, options, before))
    if not fitting:
        return []
    text, others = fitting[0], tuple(fitting[1:])
    as_given = "the adjustment fails" if solution is None else f"sigma0 is {solution.sigma0:.3g}"
    rejected = "" if before in (0, np.inf) else f", and {several(int(before), 'observation', 'is', 'are')} left out"
    return [
        Finding(
            "mirrored_models",
            "warning",
            f"the models fit with {text}; as given {as_given}{rejected}",
            "look at the signs of its axes; common points in a plane do not tell, give some above or below it",
            alternatives=others,
        )
    ]


def _fitting_mirrored(block: Block, options: ModelAdjustmentOptions, before: float) -> Iterator[str]:
    """Models and axes with which, reversed, the models fit and less than before is rejected."""
    coordinates = block.model_coordinates
    assert coordinates is not None
    for name in np.unique(coordinates.model).tolist():
        for axis in AXES:
            xyz = coordinates.xyz.copy()
            xyz[coordinates.model == name, axis] *= -1.0
            try:
                mirrored = replace(block, model_coordinates=replace(coordinates, xyz=xyz))
                solution = adjusted_given_models(mirrored, options, exchanged=False)[0]
            except (ConvergenceError, GeometryError):
                continue
            complete = set(solution.transformations.id.tolist()) == set(coordinates.model.tolist())
            if complete and _fits(solution) and solution.suspects.staying_out.sum() < before:
                yield f"an axis of model {name} reversed (sigma0 {solution.sigma0:.3g})"
                break


def _fits(solution: Solution) -> bool:
    """Whether sigma0 is not above what chance explains."""
    r = int(solution.redundancy)
    return r >= 1 and bool(solution.sigma0 <= sigma0_interval(r)[1])
