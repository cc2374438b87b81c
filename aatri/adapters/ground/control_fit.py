"""What a component on the ground says of its control: heights in another unit."""

from __future__ import annotations

import numpy as np

from aatri.adapters.imported import read_at
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.notes import Note
from aatri.observations.control import Control
from aatri.orientation.bodies.height_factor import height_factor


def height_notes(block: Block, control: Control, rows: Int, model_m: Float, what: str) -> list[Note]:
    """A warning where heights of control differ from those of the model by a factor.

    Parameters
    ----------
    block : Block
    control : Control
    rows : (k,) int
        Rows of the control that the component holds.
    model_m : (k, 3) float64, m
        Where the component, on the ground, has these points.
    what : str
        The component, for messages.

    Raises
    ------
    InputError
        If that is certain.
    """
    sigma_m = np.sqrt(control.covariance_m2[rows, 2, 2])
    found = height_factor(model_m, control.xyz_m[rows], control.given[rows], sigma_m)
    if found is None:
        return []
    if not found.certain:
        return [Note("warning", f"{what}: {found}; {found.remedy}")]
    first = int(control.row[rows][np.argmax(control.given[rows, 2])])
    where = read_at(block, block.ground_points, first)
    raise InputError(f"{what}: {found}", where=where, remedy=found.remedy)
