"""What the datum of a bundle rests on, where control and positions do not give it."""

from dataclasses import replace

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import DatumCarriers, Solution


def with_datum(block: Block, solution: Solution, datum: str, over: str) -> Solution:
    """The solution with its points or images that carry a free datum; held scalars where it is minimal.

    Parameters
    ----------
    datum, over : str
        `given`, `minimal` or `free`; over `points`, `images` or `marked` points.
    """
    if datum == "given":
        return solution
    kind, ids = "point", solution.points.id[np.isfinite(solution.points.xyz_m).all(axis=1)]
    if datum == "minimal":
        kind, ids = "held", np.array([""])
    elif over == "images":
        kind, ids = "image", solution.images.id[solution.images.oriented]
    elif over == "marked":
        ground = block.ground_points
        ids = ids[np.isin(ids, block.points.id[ground.point[ground.datum]])]
    return replace(solution, datum=DatumCarriers(kind=np.full(len(ids), kind), id=ids))
