"""Distances of relative_control.yaml between two points or two projection centres, observed or exact.

    v = |X_B - X_A| - d

Source: docs/formulas.md 5.5.
"""

from __future__ import annotations

import numpy as np

from aatri.ids import rows_of
from aatri.observations.geodetic.lengths import slope
from aatri.observations.geodetic.sights import Sights, observed_sights
from aatri.observations.level import PLANE
from aatri.observations.observed import Given, Observed

KIND = "relative_distance"

USES = ("relative_control:distance",)


def relative_distances(given: Given) -> tuple[Observed, ...]:
    """Distances of the relative control."""
    control, members = given.block.relative_control, given.block.relative_control_members
    row = np.flatnonzero(control.type == "distance")
    first = np.searchsorted(members.condition, row)
    image = members.part[first] == "images"
    ends = [members.id[first + k] for k in range(2)]
    at, to = (np.where(image, rows_of(ids, given.block.images.id), rows_of(ids, given.block.points.id)) for ids in ends)
    zero, empty = np.zeros(len(row)), np.full(len(row), "")
    names = np.array([f"{a}-{b}" for a, b in zip(*ends)], dtype=np.str_)
    sights = Sights(row, at, to, image, image, zero, zero, control.value[row], control.sigma[row], names, empty, empty,
                    empty)  # fmt: skip
    return tuple(observed_sights(KIND, sights, PLANE, slope, "m"))
