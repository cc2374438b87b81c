"""What a body on the ground says of its control: heights in another unit."""

import numpy as np

from aatri.adapters.imported import read_at
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.orientation.bodies.absolute import OrientedBody
from aatri.orientation.bodies.height_factor import height_factor


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
