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

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.plugin import SILENT, Context, stage

from ._film import FiducialOptions, oriented_film


@stage(version=2, uses=("image_points.xy", "fiducial_points.xy"))
def affine(block: Block, *, options: FiducialOptions = FiducialOptions(), context: Context = SILENT) -> ImagePoints:
    """Photo coordinates of film by fiducial marks; of other images by calibration."""
    return oriented_film(block, "affine", options, context)
