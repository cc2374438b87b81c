"""The images that hang by the fewest common points."""

import numpy as np

from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.report.sections.tables import MOST_ROWS, Columns, PageTable, all_rows


def weakest_images(block: Block, pairs: tuple[Int, Int, Int]) -> PageTable | None:
    """Images by their strongest tie, the weakest first: with whom, by how many points, and to how many in all."""
    left, right, count = pairs
    one, other, points = np.append(left, right), np.append(right, left), np.append(count, count)
    order = np.lexsort((-points, one))
    first = np.append(True, np.diff(one[order]) > 0)[: len(order)]
    best = order[first]
    partners = np.bincount(one, minlength=len(block.images))
    weakest = best[np.argsort(points[best], kind="stable")][:MOST_ROWS]
    columns: Columns = {
        "image": block.images.id[one],
        "best tied to": block.images.id[other],
        "common points": points,
        "tied to images": partners[one],
    }
    return all_rows("Images by their strongest tie, the weakest first", columns, weakest)
