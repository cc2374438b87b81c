"""Interior orientation by calibration: no fiducial marks, the measured system is known from the camera.

    x = size_x (column - column_0) - x_p,   y = +-size_y (row - row_0) - y_p

(column_0, row_0) is the image centre by the declared pixel origin, the sign is that of the declared direction of y,
(x_p, y_p) the principal point. Photo coordinates, already in mm from the fiducial centre, only lose the principal
point. The transformation is exactly known: its covariance is zero.

Comparator coordinates and scanned film need fiducial marks: interior_orientation/affine.
"""

import numpy as np

from aatri.adapters.interior.photo_coordinates import calibrated_interior, image_points_of
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import FiducialResiduals, ImagePoints
from aatri.artifacts.suspects import Suspects
from aatri.checks.after.outside_format import outside_format
from aatri.checks.finding import report
from aatri.checks.limits import PHOTO_MARGIN
from aatri.plugin import SILENT, Context, stage


@stage(version=1, uses=("image_points.xy",))
def calibrated(block: Block, *, context: Context = SILENT) -> ImagePoints:
    """Photo coordinates from pixels or given photo coordinates, reduced to the principal point."""
    interior = calibrated_interior(block, np.flatnonzero(block.images.active))
    image_points = image_points_of(
        block,
        interior,
        fiducial_residuals=FiducialResiduals.empty(),
        suspects=Suspects.empty(),
        margin=PHOTO_MARGIN,
    )
    report(outside_format(block, image_points), context)
    return image_points
