"""Scale-invariant features of one image, spread over its cells and over scales.

    D = G(k sigma) * I - G(sigma) * I,   extrema in x, y and sigma, refined by a parabola

The image is doubled before the first octave, its pixels about their centres (`enable_precise_upscale`): by OpenCV's
default way every point lies 0.25 px off to the right and below, which between strips flown to and fro looks like a
principal point. Of the orientations of a place the strongest stays, so that no place becomes two points.

Of each cell the features are taken in turn from large, middle and small scales, those of most contrast first: large
ones find pairs, small ones measure.

`features_by_colmap` takes those of COLMAP (pycolmap) on the processor, its own way from grey values to descriptors, as
a second opinion: of the orientations of a place one stays, and the largest features are kept.

Source: Lowe 2004, IJCV 60, 91; OpenCV issue 23123 (the shift); Arandjelovic & Zisserman 2012 (root of the histograms);
Vedaldi & Fulkerson 2010 (VLFeat, which COLMAP uses).
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.features import Features, Keypoints, MatchedKeypoints, Matches
from aatri.extras import of_extra
from aatri.pixels.matching import matched
from aatri.pixels.reading import Grey, grey_and_mask

CONTRAST, EDGE, SIGMA, OCTAVE_LAYERS = 0.02, 10.0, 1.6, 3
"""Settings of OpenCV's features as Lowe has them, with half his threshold of contrast: the spreading chooses."""
SCALE_CLASSES = (4.0, 8.0)
"""Diameters in px that part small, middle and large features."""

COLMAP_ERRORS = 2
"""Least severity of COLMAP's own messages that are printed (0 information, 1 warnings, 2 errors)."""


def features_of(path: str, mask: str, content: str, most: int, cells: int) -> Features:
    """Features of a file.

    Parameters
    ----------
    path, mask : str
        Files; a mask is 0 where no feature is to be, `""` is none.
    content : str
        SHA-256 that the block has of the files.
    most : int
        Features at most.
    cells : int
        Cells along the longer side.

    Raises
    ------
    InputError
        As `grey_and_mask`.
    """
    grey, seen = grey_and_mask(path, mask, content)
    return Features(keypoints=keypoints_of(grey, most, cells, seen))


def keypoints_of(grey: Grey, most: int, cells: int = 16, seen: Bool | None = None) -> Keypoints:
    """Features of an image (height, width).

    Parameters
    ----------
    most, cells : int
        As of `features_of`.
    seen : (height, width) bool, optional
        Where features may be.
    """
    cv2 = of_extra("cv2", "images")
    cv2.setNumThreads(1)
    sift = cv2.SIFT_create(0, OCTAVE_LAYERS, CONTRAST, EDGE, SIGMA, enable_precise_upscale=True)
    points = sift.detect(grey, None if seen is None else seen.astype(np.uint8) * 255)
    if not points:
        return Keypoints.empty()
    table = np.array([(*p.pt, p.size, p.angle, p.response) for p in points])
    # of features at one place the first: further orientations are no further points
    _, first = np.unique(np.round(table[:, :2], 2), axis=0, return_index=True)
    kept = np.sort(first)
    kept = kept[spread(table[kept, :2], table[kept, 2], table[kept, 4], (grey.shape[1], grey.shape[0]), most, cells)]
    kept_points, descriptors = sift.compute(grey, [points[k] for k in np.sort(kept)])
    table = np.array([(*p.pt, p.size, p.angle, p.response) for p in kept_points])
    return Keypoints(
        xy_px=table[:, :2],
        size_px=table[:, 2],
        angle_rad=np.radians(table[:, 3]),
        response=table[:, 4],
        descriptor=(descriptors - 128.0).astype(np.int8),
    )


def spread(xy_px: Float, size_px: Float, response: Float, format_px: tuple[int, int], most: int, cells: int) -> Int:
    """Rows of at most `most` features, taken from all cells in turn, and in each from all scales in turn.

    Parameters
    ----------
    xy_px : (n, 2) float64, px
    size_px, response : (n,) float64
    format_px : (int, int)
        Width and height.
    most, cells : int
        As of `features_of`.
    """
    side = max(format_px) / cells
    cell = (xy_px[:, 1] // side).astype(np.int64) * cells + (xy_px[:, 0] // side).astype(np.int64)
    scale = np.searchsorted(SCALE_CLASSES, size_px)
    in_class = rank_in(cell * 3 + scale, -response)
    in_cell = rank_in(cell, in_class * 3 + scale)
    return np.lexsort((-response, in_cell))[:most]


def rank_in(group: Int, key: Float | Int) -> Int:
    """Place of each row in its group, by ascending key, (n,)."""
    order = np.lexsort((key, group))
    first = np.searchsorted(group[order], group[order])
    rank = np.empty(len(group), dtype=np.int64)
    rank[order] = np.arange(len(group)) - first
    return rank


def features_by_colmap(path: str, mask: str, content: str, most: int) -> Features:
    """Features of a file, as `features.features_of`."""
    grey, seen = grey_and_mask(path, mask, content)
    pycolmap = of_extra("pycolmap", "colmap")
    pycolmap.logging.minloglevel = COLMAP_ERRORS
    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu, options.num_threads = False, 1
    options.sift.max_num_features, options.sift.max_num_orientations = most, 1
    points, descriptors = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu).extract_from_uint8_array(grey)
    table = np.array([(p.x, p.y, p.compute_scale(), p.compute_orientation()) for p in points]).reshape(-1, 4)
    xy_px = table[:, :2] - 0.5
    kept = np.arange(len(table))
    if seen is not None:
        column, row = np.clip(xy_px.round().astype(int), 0, np.array(grey.shape[::-1]) - 1).T
        kept = np.flatnonzero(seen[row, column])
    return Features(
        keypoints=Keypoints(
            xy_px=xy_px[kept],
            size_px=2 * table[kept, 2],
            angle_rad=table[kept, 3],
            response=np.zeros(len(kept)),
            descriptor=(np.asarray(descriptors.data).reshape(-1, 128)[kept].astype(np.int16) - 128).astype(np.int8),
        )
    )


def matches_of_roots(left: Features, right: Features, ratio: float) -> Matches:
    """Matches of two images whose descriptors are roots already: mutual, and clearly nearer than the second."""
    roots = []
    for features in (left, right):
        d = features.keypoints.descriptor.astype(np.float32) + 128.0
        roots.append(d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9))
    rows = matched(roots[0], roots[1], ratio)
    return Matches(pairs=MatchedKeypoints(left=rows[:, 0], right=rows[:, 1]))
