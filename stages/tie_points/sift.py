"""Tie points by scale-invariant features: found in each image, matched in pairs, checked by five points, joined.

    D = G(k s) * I - G(s) * I          features: extrema in x, y and scale, spread over the cells of an image
    d_1 < 0.8 d_2, mutual              matches
    u1' E u2 = 0                       checked by five-point essential matrices and data snooping
    s = s_0 max(size / smallest, 1)    standard deviation of an image point, by the size of its feature

Features of an image and matches of a pair are kept one by one: what was killed goes on, an image more makes itself and
its pairs. Pairs are images near each other (by positions), of one strip, all, or those whose largest features match.
Matches that pass the check are joined to tracks; a track with two features of one image is refused. What passes goes on
to `initial_orientation/graph` and the bundle, which search again for what a pair alone cannot show.

Image points that the block has already, of control, stay. Source: Lowe 2004, IJCV 60, 91; Nister, PAMI 26 (2004) 756.
"""

from aatri.artifacts.block import Block
from aatri.pixels.features import features_of
from aatri.pixels.matching import matches_of
from aatri.plugin import SILENT, Context, Field, stage

from ._features import FeatureOptions, with_features


class SiftOptions(FeatureOptions):
    """Options of the tie points by features."""

    cells: int = Field(16, ge=1, description="cells along the longer side of an image, from which features are taken")


@stage(version=1, uses=())
def sift(block: Block, *, options: SiftOptions = SiftOptions(), context: Context = SILENT) -> Block:
    """Find tie points."""
    return with_features(block, features_of, (options.most, options.cells), matches_of, options, context)
