"""Pictures of marks, drawn with antialiased edges, their centre in the middle of the picture.

cross   two strokes of a width, as long as the mark        dot    a disc        ring   a disc without its inner part
"""

from typing import Literal

import numpy as np

from aatri.arrays import Float

Shape = Literal["cross", "dot", "ring"]
FINE = 8
"""Parts of a pixel along each side in which it is drawn."""
BLUR_PX = 1.0
"""Of film and scanner, standard deviation."""
MARGIN = {"cross": 1.0, "dot": 1.4, "ring": 1.4}
"""Side of the picture in sizes of the mark. A disc needs its background to be found; of a cross the corners of the
picture must not reach beyond the dark ground that it stands on, which is seldom much larger."""


def drawn(shape: Shape, size_px: float, stroke_px: float) -> Float:
    """A mark, 1 on 0, (n, n) with n odd.

    Parameters
    ----------
    size_px : float
        Length of the strokes, or diameter.
    stroke_px : float
        Width of the strokes, or of the ring.
    """
    half = int(np.ceil(MARGIN[shape] * size_px / 2)) + 1
    side = 2 * half + 1
    at = (np.arange(side * FINE) + 0.5) / FINE - side / 2
    x, y = np.meshgrid(at, at)
    r, largest = np.hypot(x, y), np.maximum(abs(x), abs(y))
    inside = {
        "cross": (np.minimum(abs(x), abs(y)) < stroke_px / 2) & (largest < size_px / 2),
        "dot": r < size_px / 2,
        "ring": (r < size_px / 2) & (r > size_px / 2 - stroke_px),
    }[shape]
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(inside.reshape(side, FINE, side, FINE).mean(axis=(1, 3)), BLUR_PX))
