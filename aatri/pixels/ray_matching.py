"""The rays of one point matched by least squares: every image point brought onto the patch of the best one.

The reference is the image point with the median size of feature, or the most precise: its window is the template, and
the windows of the others are brought onto it by an affine transformation, gain and offset, from the turn and scale that
two rays' orientations or features say. A ray that correlates less than the limit, or moves farther than its standard
deviation lets it, is not measured anew.

Source: Gruen 1985, South African Journal of Photogrammetry 14, 175.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.features import FoundMarks, ScanMarks
from aatri.pixels.least_squares_matching import Matched, least_squares_match, part_shifts
from aatri.pixels.reading import Grey, check_content, grey_image

AROUND = 2
"""Half side of the window that is searched, by that of the template."""


def matched_rays(left: str, right: str, contents: list[str], half_px: int, places: list[list[float]]) -> ScanMarks:
    """Image points of the right image by the patches of the left one, then as many of the left one.

    Parameters
    ----------
    left, right : str
        Files.
    contents : list of str
        SHA-256 that the block has of both.
    half_px : int
        Half side of a patch.
    places : list of 8 float
        x, y in the left image, x, y nearly in the right one, px from the centre of the first; and the linear map
        (row by row) of pixels of the left image to those of the right one.

    Raises
    ------
    InputError
        If a file is not the one that the block was made with.
    """
    for path, content in zip((left, right), contents):
        check_content(content, path)
    a, b = grey_image(left), grey_image(right)
    rays = [_ray(a, b, half_px, np.array(place)) for place in places]
    shifts_px2 = part_shifts([match for match, _ in filter(None, rays)])
    half, lost = 0.5, (np.nan, np.nan, np.nan, np.nan, 0.0)
    rows = [(*ray[1], *ray[0].sigma_px(shifts_px2, half), ray[0].correlation) if ray else lost for ray in rays]
    rows += [
        (*place[:2], *np.sqrt(half * np.diag(ray[0].noise_px2)), ray[0].correlation) if ray else lost
        for place, ray in zip(places, rays)
    ]
    table = np.array(rows).reshape(-1, 5)
    return ScanMarks(
        width_px=b.shape[1],
        height_px=b.shape[0],
        marks=FoundMarks(
            xy_px=table[:, :2], sigma_px=table[:, 2:4], correlation=table[:, 4], second=np.zeros(len(table))
        ),
    )


def _ray(a: Grey, b: Grey, half: int, place: Float) -> tuple[Matched, Float] | None:
    """A match, and the place of the point by it."""
    from_a, near_b, linear = place[:2], place[2:4], place[4:].reshape(2, 2)
    template, centre = _patch(a, from_a, half + 1)
    if template is None:
        return None
    # the patch of the left image about the point itself: shifted by parts of a pixel on both sides alike
    offset = from_a - centre
    window, corner = _patch(b, near_b, AROUND * half)
    if window is None:
        return None
    reach = AROUND * half
    start = near_b - corner + reach - linear @ offset
    matched = least_squares_match(window, template[1:-1, 1:-1], start, "affine", linear)
    if matched is None:
        return None
    return matched, matched.xy_px + matched.linear @ offset + corner - reach


def _patch(image: Grey, centre: Float, half: int) -> tuple[Float | None, Int]:
    """The window about a whole pixel next to a place, and that pixel; None where it leaves the image."""
    at = np.round(centre).astype(np.int64)
    (x, y), (height, width) = at, image.shape
    if x < half or y < half or x + half >= width or y + half >= height:
        return None, at
    return image[y - half : y + half + 1, x - half : x + half + 1].astype(np.float64), at


def median_rows(point: Int, sigma: Float) -> Int:
    """Of each image point (n,) the row of that image point of its point which has the median standard deviation."""
    order = np.lexsort((sigma, point))
    ids, first, count = np.unique(point[order], return_index=True, return_counts=True)
    return np.asarray(order[first + (count - 1) // 2][np.searchsorted(ids, point)])


def medians_of_points(point: Int, sigma_px: Float, n_points: int) -> Float:
    """Median standard deviations (n_points, 2) of the image points (n, 2) of each point; NaN where there are none."""
    made = np.full((n_points, 2), np.nan)
    for axis in (0, 1):
        rows = median_rows(point, sigma_px[:, axis])
        made[point, axis] = sigma_px[rows, axis]
    return made
