"""Distances of relative_control.yaml between two points or two projection centres, observed or exact.

    v = |X_B - X_A| - d

Source: docs/formulas.md 5.5.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aatri.ids import rows_of
from aatri.observations.geodetic.lengths import slope
from aatri.observations.geodetic.sights import Sights, observed_sights
from aatri.observations.level import PLANE
from aatri.observations.observed import Given, Observed

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "relative_distance"

USES = ("relative_control:distance",)


def relative_distances(given: Given) -> tuple[Observed, ...]:
    """Distances of the relative control."""
    return tuple(observed_sights(KIND, relative_sights(given.block), PLANE, slope, "m"))


def relative_sights(block: Block) -> Sights:
    """Distances of the relative control as sights."""
    control, members = block.relative_control, block.relative_control_members
    row = np.flatnonzero(control.type == "distance")
    first = np.searchsorted(members.condition, row)
    image = members.part[first] == "images"
    ends = [members.id[first + k] for k in range(2)]
    at, to = (np.where(image, rows_of(ids, block.images.id), rows_of(ids, block.points.id)) for ids in ends)
    zero, empty = np.zeros(len(row)), np.full(len(row), "")
    names = np.array([f"{a}-{b}" for a, b in zip(*ends)], dtype=np.str_)
    return Sights(
        row, at, to, image, image, zero, zero, control.value[row], control.sigma[row], names, empty, empty, empty
    )
