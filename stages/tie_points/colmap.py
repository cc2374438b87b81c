"""Tie points by the features of COLMAP (pycolmap), on the processor: a second opinion beside `sift`.

    D = G(k s) * I - G(s) * I          features: extrema in x, y and scale; the largest are kept
    d_1 < 0.8 d_2, mutual              matches
    u1' E u2 = 0                       checked by five-point essential matrices and data snooping
    s = s_0 max(size / smallest, 1)    standard deviation of an image point, by the size of its feature

Everything but the features is as in `sift`: pairs, check, tracks, what is kept and goes on after a kill. COLMAP keeps
the largest features, which are the least precise ones, and takes some three times as long.

Source: Lowe 2004, IJCV 60, 91; Schoenberger & Frahm, CVPR 2016.
"""

from aatri.artifacts.block import Block
from aatri.pixels.features import features_by_colmap, matches_of_roots
from aatri.plugin import SILENT, Context, stage

from ._features import FeatureOptions, with_features


class ColmapFeatureOptions(FeatureOptions):
    """Options of the tie points by COLMAP's features."""


@stage(version=1, uses=())
def colmap(block: Block, *, options: ColmapFeatureOptions = ColmapFeatureOptions(), context: Context = SILENT) -> Block:
    """Find tie points."""
    return with_features(block, features_by_colmap, (options.most,), matches_of_roots, options, context)
