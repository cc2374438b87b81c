"""The usual errors of the coordinates of control: what they would be without each of them, and what to do about it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.checks.limits import ZONE_EASTING_M
from aatri.units import FOOT_M, LENGTH_M


@dataclass(frozen=True)
class Change:
    """One error undone."""

    text: str
    """`with X and Y exchanged`."""
    of_all: str
    of_one: str
    """What to do if all control has it, if one point has it."""
    apply: Callable[[Float], Float]
    """(n, 3) coordinates to (n, 3), m."""
    in_plan: bool = True
    """It moves points in plan; else heights alone."""
    moves_near: bool = False
    """It proves something also near the origin, where factors gather points."""


def _times(x: float, y: float, z: float) -> Callable[[Float], Float]:
    return lambda xyz: xyz * [x, y, z]


def _without_zone(xyz: Float) -> Float:
    return np.column_stack([xyz[:, 0] % ZONE_EASTING_M, xyz[:, 1:]])


_AXES = "write `axes: [north, east, up]` (or the other way round) for this frame"
_IN_METRES = "convert it to metres"
_DIVIDED = "taken as metres that were divided by 0.3048"
KM, CM, MM = (LENGTH_M[unit] for unit in ("km", "cm", "mm"))
SWAPPED = Change(
    "with X and Y exchanged", _AXES, "exchange the two coordinates", lambda xyz: xyz[:, [1, 0, 2]], moves_near=True
)
CHANGES = (
    SWAPPED,
    Change("with heights taken as feet", "convert the heights to metres", "", _times(1, 1, FOOT_M), in_plan=False),
    Change(f"with heights {_DIVIDED}", "give the heights in metres", "", _times(1, 1, 1 / FOOT_M), in_plan=False),
    Change("with heights divided by 1000", "give the heights in metres", "", _times(1, 1, MM), in_plan=False),
    Change("with the sign of the heights turned", "heights count upwards", "", _times(1, 1, -1), in_plan=False),
    Change("taken as feet", _IN_METRES, _IN_METRES, _times(FOOT_M, FOOT_M, FOOT_M)),
    Change(_DIVIDED, _IN_METRES, _IN_METRES, _times(1 / FOOT_M, 1 / FOOT_M, 1 / FOOT_M)),
    Change("times 1000", "set units: {ground: km}", _IN_METRES, _times(KM, KM, KM)),
    Change("divided by 100", "set units: {ground: cm}", _IN_METRES, _times(CM, CM, CM)),
    Change("divided by 1000", "set units: {ground: mm}", _IN_METRES, _times(MM, MM, MM)),
    Change(
        "without the zone number before the easting",
        "take the zone number off",
        "take the zone number off",
        _without_zone,
    ),
)
"""The simple ones first."""
