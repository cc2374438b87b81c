"""Models given by coordinates of which one has another unit than its standard deviations or the others.

Seen: coordinates in micrometres or inches among models in millimetres, with the standard deviation of these.
Test: the scale of a model, and its standard deviation on the ground, are each `OTHER_UNIT` times that of the median
model and more, or less by as much. A model of another scale with standard deviations of its own is none.
"""

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.checks.finding import Finding
from aatri.checks.limits import OTHER_UNIT


def models_of_another_unit(block: Block, solution: Solution) -> list[Finding]:
    """A warning for each model whose scale and precision are both far from those of the others.

    Parameters
    ----------
    block : Block
        With coordinates of models.
    solution : Solution
        By these models, each with its similarity to the ground.
    """
    t, coordinates = solution.transformations, block.model_coordinates
    if coordinates is None:
        return []
    of_scale = t.parameter == "scale"
    names, scale = t.id[of_scale], t.value[of_scale]
    sigma_m = scale * [np.median(coordinates.sigma[coordinates.model == name]) for name in names]
    usual, usual_m = (float(np.exp(np.median(np.log(values)))) for values in (scale, sigma_m))
    far = np.abs(np.log([scale / usual, sigma_m / usual_m])).min(axis=0) > np.log(OTHER_UNIT)
    return [
        Finding(
            "model_units",
            "warning",
            f"model {names[k]} has another unit: {scale[k]:.3g} m on the ground, of the others {usual:.3g} m (median); "
            f"its standard deviations are {1e3 * sigma_m[k]:.3g} mm there, of the others {1e3 * usual_m:.3g} mm",
            "write its coordinates in their unit, or its standard deviations in its own",
        )
        for k in np.flatnonzero(far).tolist()
    ]
