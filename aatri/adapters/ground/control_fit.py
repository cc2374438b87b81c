"""What a body on the ground says of its control: heights in another unit, a principal distance that is wrong."""

import numpy as np

from aatri.adapters.imported import read_at
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.orientation.bodies.absolute import OrientedBody
from aatri.orientation.bodies.height_factor import height_factor

CHECK_DISTANCE = "check principal distance and pixel size, both in mm, and unit and reference of the heights"


def stretched(block: Block, body: OrientedBody) -> str:
    """In words, by what factor control and positions together ask for another principal distance; else empty.

    A principal distance too long by f stretches a model along its rays: its heights, and the flying height above it.
    Over flat ground a common error of the heights of all positions does the same.
    """
    places = body.places
    factor = height_factor(places.xyz, places.observed_m, places.given)
    if factor is None:
        return ""
    levels_m = [
        np.median(places.observed_m[of & places.given[:, 2], 2])
        for of in (places.kind == CONTROL, places.kind != CONTROL)
        if (of & places.given[:, 2]).any()
    ]
    c_mm = np.unique(block.cameras.principal_distance_mm[block.images.camera])
    share = f"{factor.factor:.3f} (+- {factor.sigma:.2g}) times as much as those of the models"
    if len(levels_m) < 2 or len(c_mm) > 1:
        return f"given heights vary {share}: their unit or a principal distance is wrong"
    off_m = (levels_m[1] - levels_m[0]) * (1 / factor.factor - 1)
    distance = f"a principal distance of {c_mm[0] * factor.factor:.2f} mm instead of {c_mm[0]:.2f} mm"
    higher = f"positions {abs(off_m):.3g} m {'higher' if off_m > 0 else 'lower'}"
    return f"heights of control and positions vary {share}: {distance} would explain it, or {higher}"


def height_notes(block: Block, body: OrientedBody, what: str) -> list[Note]:
    """A warning where heights of control differ from those of the model by a factor.

    Raises
    ------
    InputError
        If that is certain.
    """
    observed = body.tied.problem.observed
    control = [o for o in observed if o.kind == CONTROL and len(o)]
    if not control:
        return []
    places = body.places
    places = places.take(places.kind == CONTROL)
    sigma_m, row = (np.concatenate(columns) for columns in zip(*((o.sigmas()[:, 2], o.row) for o in control)))
    factor = height_factor(places.xyz, places.observed_m, places.given, sigma_m)
    if factor is None:
        return []
    if not factor.certain:
        return [Note("warning", f"{what}: {factor}; {factor.remedy}")]
    where = read_at(block, block.ground_points, int(row[np.argmax(places.given[:, 2])]))
    raise InputError(f"{what}: {factor}", where=where, remedy=factor.remedy)
