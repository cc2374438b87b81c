"""What strips do not control: image points in one model of their strip or in none, joints of one connection point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.adapters.solution import stacked
from aatri.adapters.strips.model_chains import Chain, active_rows
from aatri.adapters.uncontrolled_before import seen_by_one, still_in_no_model, unchecked
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import StripPoints
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.orientation.strips.joints import JointTable


def uncontrolled_in_strips(
    block: Block, models: Models, points: StripPoints, joints: JointTable, chains: Sequence[Chain]
) -> Uncontrolled:
    """Of formed strips.

    Parameters
    ----------
    points : StripPoints
        Ascending by strip and point.
    joints : JointTable
        Its rows are those of `active_rows(models)`.
    chains : sequence of Chain
        The strips in their order.
    """
    p, n = models.model_points, len(block.points)
    rows = active_rows(models)
    strip = np.full(len(models.orientations), -1, dtype=np.int64)
    for number, chain in enumerate(chains):
        strip[chain.models] = number
    made = np.zeros(len(joints.first), dtype=bool)
    made[[k for chain in chains for k in chain.joints]] = True
    use = strip[p.model[rows]] >= 0
    rejected = ~joints.active & made[joints.of_row()]
    use[joints.first_row[rejected]] = use[joints.second_row[rejected]] = False
    rows = rows[use]
    key = points.strip.astype(np.int64) * n + points.point
    place = np.searchsorted(key, strip[p.model[rows]] * n + p.point[rows])
    single = points.models[place] == 1
    alone = np.flatnonzero(joints.active & (made & (joints.used() == 1))[joints.of_row()])
    ties = unchecked(
        "model_tie",
        models.orientations.id[joints.second[joints.of_row()[alone]]],
        block.points.id[p.point[active_rows(models)[joints.second_row[alone]]]],
    )
    return stacked([still_in_no_model(models.uncontrolled), seen_by_one(block, models, rows[single]), ties])
