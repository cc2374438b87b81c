"""Interior orientation of film images by an affine transformation onto the calibrated fiducial marks.

    x = a0 u + a1 v + a2 - x_p,   y = b0 u + b1 v + b2 - y_p

(u, v) measured in comparator mm or pixels, (x_p, y_p) the principal point; least squares over the marks of each image,
weighted by their standard deviations. Six parameters: shift and rotation of the film on the
comparator, and with them its affine deformation, two scales and a shear. Three marks are needed.
Method and tests: aatri.orientation.interior.fiducial_fit.

A mark with a gross error is rejected where the redundancy can locate it (not with four marks). sigma0 of all images
together has the global test; single images that do not fit are listed, at the level 0.05 / count. An image with fewer
than three marks, or whose marks fit nothing, is not used; more than 5 % of such images are an error, as are marks with
exchanged numbers, mirrored marks and a wrong scale.

Images whose camera gives photo coordinates, and digital ones, need no marks: they go the way of
interior_orientation/calibrated, so that a block may hold both.

Source: Kraus, Photogrammetry 1, sec. 3.2; photogrammetric practice for the limits.
"""

from __future__ import annotations

from aatri.adapters.interior.film_orientation import film_orientation
from aatri.adjustment.statistics.global_test import MAX_SIGMA0
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class AffineOptions(Options):
    """Options of the affine interior orientation."""

    test_limit: float = Field(
        4.0, gt=0, description="a fiducial mark with a larger test statistic is rejected, in standard deviations"
    )
    max_sigma0: float = Field(MAX_SIGMA0, gt=0, description="an image whose sigma0 is larger is not used")


@stage(version=2, uses=("image_points.xy", "fiducial_points.xy"))
def affine(block: Block, *, options: AffineOptions = AffineOptions(), context: Context = SILENT) -> ImagePoints:
    """Photo coordinates of film by fiducial marks; of other images by calibration."""
    made, notes = film_orientation(block, "affine", options.test_limit, options.max_sigma0)
    tell(notes, context)
    return made
