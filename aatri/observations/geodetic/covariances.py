"""Geodetic observations joined by covariances.csv."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from aatri.observations.correlated import joined
from aatri.observations.geodetic import differences, directions, distances, zenith_angles
from aatri.observations.observed import Observed

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KINDS = frozenset(
    {
        *(distances.KIND, distances.HORIZONTAL, directions.DIRECTION, directions.AZIMUTH, directions.ANGLE),
        *(zenith_angles.KIND, differences.HEIGHT_DIFFERENCE, differences.COORDINATE_DIFFERENCE),
    }
)
"""Kinds whose rows are those of geodetic.csv."""

USES = ("geodetic_covariances",)


def with_geodetic_covariances(block: Block, observed: Sequence[Observed]) -> tuple[Observed, ...]:
    """The observations of a block, those of geodetic.csv that are correlated joined to records."""
    c = block.geodetic_covariances
    rows = [o for o in observed if o.kind in KINDS]
    others = tuple(o for o in observed if o.kind not in KINDS)
    return others + joined(rows, c.row_a, c.row_b, np.asarray(c.value), [o.row[:, None] for o in rows])
