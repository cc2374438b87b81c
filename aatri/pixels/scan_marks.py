"""The fiducial marks of one scan: a window around each place where one may be, in any turn of the scan.

    (x, y) = T (u, v)        similarity on the calibrated marks: which way the film lay, and which marks fit it

A film lies in a scanner in four ways, on either side, so that calibrated marks may lie at eight sets of places. Each
place is looked at once; only windows of the file are read.

Pictures of marks, drawn with antialiased edges, their centre in the middle of the picture.

cross   two strokes of a width, as long as the mark        dot    a disc        ring   a disc without its inner part

In its window a mark is sought by correlation with its template, turned by some degrees, then by least squares.

    r(p) = correlation of template and window, of either sign where the scan may be a negative

The verdict is what the second best place says: a mark is found where the best is like the template and clearly better
than any other place of the window.

Source: Gonzalez & Woods, Digital Image Processing (correlation); Gruen 1985 (least squares).
"""

import json
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.features import FoundMarks, ScanMarks
from aatri.extras import of_extra
from aatri.pixels.least_squares_matching import least_squares_match, part_shifts
from aatri.pixels.reading import TIFF, Samples, check_content, size_px, whole_image, window

TURNS_DEG = (0.0, -4.0, 4.0)
COARSE_PX = 24
"""Side to which a larger template is reduced to find its place."""

FEWEST = 3
"""Marks of a transformation with redundancy."""
ALIKE_MM = 0.01
"""Difference of residuals that says nothing of which way the film lay."""


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


def scan_marks(path: str, picture: str, content: str, settings: str) -> ScanMarks:
    """Search the marks of a scan.

    Parameters
    ----------
    path, picture : str
        Files: the scan, and that of a template cut out of one, `""` where it is drawn.
    content : str
        SHA-256 that the block has of the scan.
    settings : str
        JSON: `places_px` of marks from the centre of the scan, x right, y down; `half_px` of a window; `shape`,
        `size_px`, `stroke_px` of a drawn template; `negative`.

    Raises
    ------
    InputError
        If the file is not the one that the block was made with.
    """
    check_content(content, path)
    search = json.loads(settings)
    template = (
        whole_image(picture).astype(float)
        if picture
        else drawn(search["shape"], search["size_px"], search["stroke_px"])
    )
    width, height = (size_px(path) if path.lower().endswith(TIFF) else whole_image(path).shape[::-1])[:2]
    centre = (np.array([width, height]) - 1) / 2
    rows = []
    for place in np.array(search["places_px"]):
        first = np.clip(np.round(centre + place - search["half_px"]), 0, [width - 1, height - 1]).astype(int)
        last = np.clip(np.round(centre + place + search["half_px"]), 0, [width - 1, height - 1]).astype(int)
        match = best_place(_window(path, first, last).astype(float), template, negative=search["negative"])
        rows.append((*(match.xy_px + first), *match.sigma_px, match.correlation, match.second))
    table = np.array(rows)
    return ScanMarks(
        width_px=int(width),
        height_px=int(height),
        marks=FoundMarks(xy_px=table[:, :2], sigma_px=table[:, 2:4], correlation=table[:, 4], second=table[:, 5]),
    )


def _window(path: str, first: Int, last: Int) -> Samples:
    width, height = (last - first + 1).tolist()
    if path.lower().endswith(TIFF):
        return window(path, int(first[0]), int(first[1]), width, height)
    return whole_image(path)[first[1] : last[1] + 1, first[0] : last[0] + 1]


def ways_of_scanning() -> Float:
    """Linear maps (8, 2, 2) from the film (x right, y up) to a scan (x right, y down): four turns, and mirrored."""
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    turns = [np.linalg.matrix_power(quarter, k) for k in range(4)]
    upright, mirrored = np.diag([1.0, -1.0]), np.diag([-1.0, -1.0])
    return np.array([turn @ side for side in (upright, mirrored) for turn in turns])


def places_of_ways(marks_px: Float, near_px: float) -> tuple[Float, Int]:
    """Where marks may lie in a scan.

    Parameters
    ----------
    marks_px : (m, 2) float64, px
        Calibrated, from the middle of the film, x right, y up.
    near_px : float
        Places that are nearer to each other are one.

    Returns
    -------
    places_px : (k, 2) float64, px
        From the centre of the scan, x right, y down.
    place : (8, m) int64
        By way of scanning: the place of each mark.
    """
    of_ways = np.einsum("wij,mj->wmi", ways_of_scanning(), marks_px)
    places = list[Float]()
    place = np.zeros(of_ways.shape[:2], dtype=np.int64)
    for way, mark in np.ndindex(*place.shape):
        apart = [float(np.abs(p - of_ways[way, mark]).max()) for p in places]
        if not apart or min(apart) > near_px:
            places.append(of_ways[way, mark])
            apart.append(0.0)
        place[way, mark] = int(np.argmin(apart))
    return np.array(places), place


def fitting_ways(marks_mm: Float, scan_mm: Float, like: Bool, limit_mm: float) -> tuple[Bool, Int]:
    """Ways of scanning that explain where marks were found.

    Parameters
    ----------
    marks_mm : (m, 2) float64, mm
        Calibrated, x right, y up.
    scan_mm : (8, m, 2) float64, mm
        Found, by way of scanning, x right, y down.
    like : (8, m) bool
        Marks that are like their template.
    limit_mm : float
        A mark with a larger residual is left out, the worst first.

    Returns
    -------
    used : (8, m) bool
        Marks that fit.
    good : (k,) int64
        The ways with most marks and residuals that are alike; none where fewer than three fit.
    """
    fits = [_fit(way @ marks_mm.T, xy, ok, limit_mm) for way, xy, ok in zip(ways_of_scanning(), scan_mm, like)]
    used, rms = np.array([fit[0] for fit in fits]), np.array([fit[1] for fit in fits])
    most = used.sum(axis=1) == max(FEWEST, used.sum(axis=1).max())
    return used, np.flatnonzero(most & (rms <= rms[most].min(initial=np.inf) + ALIKE_MM))


def _fit(film_mm: Float, scan_mm: Float, like: Bool, limit_mm: float) -> tuple[Bool, float]:
    """Marks that fit a similarity without mirroring, the worst left out one by one, and the RMS of their residuals."""
    film, scan, used = film_mm[0] + 1j * film_mm[1], scan_mm[:, 0] + 1j * scan_mm[:, 1], like.copy()
    while used.sum() >= FEWEST:
        A = np.column_stack([film[used], np.ones(used.sum())])
        x = np.linalg.lstsq(A, scan[used], rcond=None)[0]
        residual = np.abs(A @ x - scan[used])
        upright = abs(np.angle(x[0])) < np.pi / 4  # another way of scanning has the other turns
        if residual.max() <= limit_mm and upright:
            return used, float(np.sqrt((residual**2).mean()))
        used[np.flatnonzero(used)[int(residual.argmax())]] = False
    return np.zeros(len(used), dtype=bool), np.inf


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
