"""Features by COLMAP (pycolmap) on the processor: its own way from grey values to descriptors, as a second opinion.

Of the orientations of a place one stays; the largest features are kept. Its descriptors are roots of histograms.

Source: Lowe 2004, IJCV 60, 91; Vedaldi & Fulkerson 2010 (VLFeat, which COLMAP uses).
"""

import numpy as np

from aatri.artifacts.features import Features, Keypoints, MatchedKeypoints, Matches
from aatri.extras import of_extra
from aatri.pixels.matching import matched
from aatri.pixels.reading import grey_and_mask

ERRORS = 2
"""Level of COLMAP's own messages that are printed."""


def features_by_colmap(path: str, mask: str, content: str, most: int) -> Features:
    """Features of a file, as `features.features_of`."""
    grey, seen = grey_and_mask(path, mask, content)
    pycolmap = of_extra("pycolmap", "colmap")
    pycolmap.logging.minloglevel = ERRORS
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
