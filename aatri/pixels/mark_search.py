"""Where a mark lies in a window: by correlation with its template, turned by some degrees, then by least squares.

    r(p) = correlation of template and window, of either sign where the scan may be a negative

The verdict is what the second best place says: a mark is found where the best is like the template and clearly better
than any other place of the window.

Source: Gonzalez & Woods, Digital Image Processing (correlation); Gruen 1985 (least squares).
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.extras import of_extra
from aatri.pixels.least_squares_matching import least_squares_match, part_shifts

TURNS_DEG = (0.0, -4.0, 4.0)
COARSE_PX = 24
"""Side to which a larger template is reduced to find its place."""


@dataclass(frozen=True)
class MarkFound:
    """The best place of a mark in a window."""

    xy_px: Float
    """(2,). From the centre of the first pixel of the window; NaN where least squares does not settle."""
    sigma_px: Float
    """(2,)."""
    correlation: float
    """With the template at the best place, after least squares; negative: a negative of it."""
    second: float
    """Correlation at the next best place, as a share of that of the best, both before least squares."""


def best_place(window: Float, template: Float, *, negative: bool | None) -> MarkFound:
    """The best place of a mark.

    Parameters
    ----------
    window : (h, w) float64
    template : (n, n) float64
        n odd.
    negative : bool, optional
        Whether the window is a negative of the template; None: either.
    """
    cv2 = of_extra("cv2", "images")
    cv2.setNumThreads(1)
    lost = MarkFound(np.full(2, np.nan), np.full(2, np.nan), 0.0, 1.0)
    step = max(1, len(template) // COARSE_PX)
    small, reduced = _reduced(window, step), _reduced(template, step)
    if min(small.shape) <= max(reduced.shape):
        return lost
    maps = []
    for turn in TURNS_DEG:
        M = cv2.getRotationMatrix2D(((len(reduced) - 1) / 2,) * 2, turn, 1.0)
        turned = cv2.warpAffine(
            reduced, M, reduced.shape[::-1], flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        r = cv2.matchTemplate(small, turned, cv2.TM_CCOEFF_NORMED)
        maps.append(-r if negative else r if negative is False else np.abs(r))
    r = np.nan_to_num(np.max(maps, axis=0))
    row, column = np.unravel_index(int(r.argmax()), r.shape)
    best, turn = float(r[row, column]), TURNS_DEG[int(np.argmax([m[row, column] for m in maps]))]
    if best <= 0:
        return lost
    near = max(2, len(reduced) // 3)
    others = r.copy()
    others[max(0, row - near) : row + near + 1, max(0, column - near) : column + near + 1] = 0
    second = float(others.max()) / best
    centre = (np.array([column, row]) + (len(reduced) - 1) / 2) * step + (step - 1) / 2
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    fine = least_squares_match(window, template, centre, "similarity", np.array([[c, s], [-s, c]]))
    if (
        fine is None
        or np.abs(fine.xy_px - centre).max() > len(template) / 4
        or not 0.7 < np.linalg.det(fine.linear) < 1.4
    ):
        return MarkFound(lost.xy_px, lost.sigma_px, best, second)
    return MarkFound(fine.xy_px, fine.sigma_px(part_shifts([fine])), fine.correlation, second)


def _reduced(picture: Float, step: int) -> Float:
    """A picture by means of step x step pixels, single precision."""
    h, w = (n // step for n in picture.shape)
    blocks = picture[: h * step, : w * step].reshape(h, step, w, step)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)
