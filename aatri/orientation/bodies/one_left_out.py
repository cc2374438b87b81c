"""A body whose datum one observation spoils that is no coordinate: a distance in mm, an azimuth of the other end.

Where nothing places the body, each distance, azimuth, height difference ... is left out in turn, as a start needs them
all and finds none that fits. If all else fits without one and with none of the others, the body begins without it, and
it stays rejected. If without each of several, nothing tells which of them is wrong: an error that names them.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from aatri.arrays import Bool
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import IDENTITY
from aatri.ids import shown
from aatri.notes import Note
from aatri.observations.observed import Observed
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.ground_observed import PLACES, GroundObserved, everything, oriented_by
from aatri.orientation.bodies.limits import UNDETERMINED_MOTION

MOST_LEFT_OUT_IN_TURN = 12
"""Where there are more observations that are no coordinates, none is left out: each takes an orientation of its own,
and the start of a body with so many seldom depends on a single one."""

Begin = Callable[[Sequence[Observed]], Bool]


def oriented_by_the_others(
    ground: GroundObserved,
    body: FreeBody,
    settings: OrientationSettings,
    what: str,
    failure: ConvergenceError | GeometryError,
    begin: Begin | None = None,
) -> tuple[OrientedBody, list[Note]]:
    """A body that `oriented_by` does not place, without the one observation that spoils it.

    Raises
    ------
    GeometryError, ConvergenceError
        The failure of `oriented_by`, or with the names of several of which one is wrong.
    """
    if isinstance(failure, OpenDatumError) or settings.weakest < UNDETERMINED_MOTION:  # the latter: tried before
        raise failure
    single = [
        (o, row)
        for o in ground.of(body, everything)(IDENTITY)
        if o.kind not in PLACES and not o.components and o.records.rows == 1
        for row in range(len(o))
    ]
    fits = list[tuple[tuple[OrientedBody, list[Note]], str]]()
    for o, row in single if len(single) <= MOST_LEFT_OUT_IN_TURN else []:
        others = partial(_without, o.kind, int(o.row[row]), begin)
        try:
            oriented, notes = oriented_by(ground, body, replace(settings, exchanged=False), what, begin=others)
        except (ConvergenceError, GeometryError):
            continue
        tied, of_ground = oriented.tied, others(oriented.tied.problem.ground)
        rejected = of_ground & ~tied.active[tied.problem.n_ties :][: len(of_ground)]
        if tied.tau_m == 0 and not tied.above.any() and not rejected.any():
            fits.append(((oriented, notes), f"{o.kind} {o.label(row)}"))
    if not fits:
        raise failure
    if len(fits) == 1:
        return fits[0][0]
    text = f"{what}: all that is observed of the ground fits without one of these, and nothing tells which is wrong: "
    remedy = "check their values, units and ends, and take the wrong one out, or measure another"
    raise GeometryError(text + shown([name for _, name in fits]), remedy=remedy)


def _without(kind: str, row: int, begin: Begin | None, observed: Sequence[Observed]) -> Bool:
    """What takes part at first: all but one row of a kind."""
    parts = [(o.kind != kind) | (o.row != row) for o in observed]
    others: Bool = np.concatenate([np.zeros(0, dtype=bool), *parts])
    return others if begin is None else others & begin(observed)
