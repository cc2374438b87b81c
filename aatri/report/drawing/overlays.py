"""Image points in their images: the cells that have one, and two images beside each other with what they share."""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.report.drawing.picture import Backdrop, Marks, Picture
from aatri.report.drawing.scales import thinned

MOST_IMAGES = 60
"""Of which cells are drawn: of more, those with the fewest."""

IN_A_ROW = 10
FEW, HALF = 0.3, 0.6
"""Shares of the cells with a point, between the colours; below the first `tie_points` names an image."""

GAP = 0.06
"""Between two images beside each other, of the width of one."""

MOST_JOINED = 40
"""Lines from one image to the other; more hide the images."""


@dataclass(frozen=True, eq=False)
class ImagePair:
    """Two images with the points that both have."""

    names: tuple[str, str]
    size: Float
    """(2, 2). Width and height of each, px or mm."""
    jpeg: tuple[bytes, bytes]
    """Photographs, upright as they are measured; empty where there is none."""
    point: Text
    place: Float
    """(n, 2, 2). In each image: in widths and heights from its lower left corner."""
    used: Bool
    """(n,). In both."""


def cells_picture(names: Text, filled: Bool, images: Int) -> Picture:
    """The cells of images with a point, of at most `MOST_IMAGES` images with the fewest.

    Parameters
    ----------
    names : (n,) str
    filled : (n, rows, columns) bool
        Rows from below.
    images : (m,) int
        Of which there may be pictures.
    """
    share = filled.mean(axis=(1, 2))
    fewest = images[np.argsort(share[images], kind="stable")]
    drawn = fewest[:MOST_IMAGES]
    rows, columns = filled.shape[1:]
    place = np.arange(len(drawn))
    corner = np.column_stack([place % IN_A_ROW, -(place // IN_A_ROW)]) * np.array([1.25, 1.4])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    marks = []
    for colour, name, low, high in (
        ("red", f"less than {FEW:.0%} of the cells have a point", -1.0, FEW),
        ("amber", f"less than {HALF:.0%}", FEW, HALF),
        ("blue", "more", HALF, 2.0),
    ):
        of_step = np.flatnonzero((share[drawn] >= low) & (share[drawn] < high))
        image, row, column = np.nonzero(filled[drawn[of_step]])
        cell = (np.column_stack([column, row])[:, None] + square) / np.array([columns, rows])
        tells = [f"{k} of {rows * columns} cells" for k in filled[drawn[of_step]].sum(axis=(1, 2)).tolist()]
        marks.append(Marks("areas", corner[of_step][image][:, None] + cell, colour, name, 0.0, 0.55))
        frames = corner[of_step][:, None] + square
        ids = names[drawn[of_step]].tolist()
        marks.append(Marks("areas", frames, colour, width=0.8, ids=ids, tells=tells))
    marks.append(Marks("texts", corner + np.array([-0.04, -0.2]), "ink", ids=names[drawn].tolist()))
    few = int((share[images] < FEW).sum())
    caption = (
        f"Cells of the images, {columns} x {rows} each, that have an image point in use; in the mean "
        f"{share[images].mean():.0%}. Nothing ties the rest of an image, and a block with many empty cells bends: "
        f"{few:,} of {len(images):,} images {'has' if few == 1 else 'have'} a point in less than {FEW:.0%}."
    )
    caption += f" Drawn: the {len(drawn)} with the fewest." if len(drawn) < len(images) else ""
    return Picture("cells", "Cells with a point", caption, marks, ground=False, width=900.0)


def pair_picture(name: str, title: str, pair: ImagePair) -> Picture:
    """Two images beside each other, their common points green, those that are left out red."""
    width = pair.size[0, 0] * (1 + GAP)
    at = pair.place * pair.size + np.array([[0.0, 0.0], [width, 0.0]])
    low = np.array([[0.0, 0.0], [width, 0.0]])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    marks = [Marks("areas", low[:, None] + square * pair.size[:, None], "soft")]
    for colour, words, mask in (("green", "used", pair.used), ("red", "left out", ~pair.used)):
        rows = np.flatnonzero(mask)
        joined = rows[thinned(len(rows), MOST_JOINED)]
        marks.append(Marks("segments", at[joined], colour, width=0.5))
        ids = np.repeat(pair.point[rows], 2).tolist()
        tells = [words] * len(ids)
        marks.append(Marks("dots", at[rows].reshape(-1, 2), colour, words, 4.0, ids=ids, tells=tells))
    lower = np.array([[0.0, 0.0], [width, 0.0]]) - [0.0, 0.05 * pair.size[:, 1].max()]
    marks.append(Marks("texts", lower, "ink", ids=list(pair.names)))
    out = int((~pair.used).sum())
    caption = (
        f"{pair.names[0]} and {pair.names[1]}: {len(pair.used) - out:,} common points are used, {out:,} left out. "
        "Lines join some of them: those that cross the others are wrong."
    )
    backdrops = [Backdrop(jpeg, a, a + size) for jpeg, a, size in zip(pair.jpeg, low, pair.size) if jpeg]
    return Picture(name, title, caption, marks, ground=False, backdrops=backdrops, width=900.0)
