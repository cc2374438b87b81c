"""The fiducial marks of one scan: a window around each place where one may be, in any turn of the scan.

    (x, y) = T (u, v)        similarity on the calibrated marks: which way the film lay, and which marks fit it

A film lies in a scanner in four ways, on either side, so that calibrated marks may lie at eight sets of places. Each
place is looked at once; only windows of the file are read.
"""

import json

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.features import FoundMarks, ScanMarks
from aatri.pixels.drawn_marks import drawn
from aatri.pixels.limits import ALIKE_MM, FEWEST_MARKS
from aatri.pixels.mark_search import best_place
from aatri.pixels.reading import TIFF, Samples, check_content, size_px, whole_image, window


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
    most = used.sum(axis=1) == max(FEWEST_MARKS, used.sum(axis=1).max())
    return used, np.flatnonzero(most & (rms <= rms[most].min(initial=np.inf) + ALIKE_MM))


def _fit(film_mm: Float, scan_mm: Float, like: Bool, limit_mm: float) -> tuple[Bool, float]:
    """Marks that fit a similarity without mirroring, the worst left out one by one, and the RMS of their residuals."""
    film, scan, used = film_mm[0] + 1j * film_mm[1], scan_mm[:, 0] + 1j * scan_mm[:, 1], like.copy()
    while used.sum() >= FEWEST_MARKS:
        A = np.column_stack([film[used], np.ones(used.sum())])
        x = np.linalg.lstsq(A, scan[used], rcond=None)[0]
        residual = np.abs(A @ x - scan[used])
        upright = abs(np.angle(x[0])) < np.pi / 4  # another way of scanning has the other turns
        if residual.max() <= limit_mm and upright:
            return used, float(np.sqrt((residual**2).mean()))
        used[np.flatnonzero(used)[int(residual.argmax())]] = False
    return np.zeros(len(used), dtype=bool), np.inf
