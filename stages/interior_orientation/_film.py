"""What the variants by fiducial marks share: options and the way from marks to photo coordinates."""

import numpy as np

from aatri.adapters.interior.film_marks import (
    film_images,
    film_interior,
    film_marks,
    film_residuals,
    film_suspects,
    of_usable,
    snooped_marks,
    unusable_film,
)
from aatri.adapters.interior.photo_coordinates import calibrated_interior, image_points_of
from aatri.adapters.solution import stacked
from aatri.adjustment.statistics.limits import MAX_SIGMA0
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.checks.after.film import film as film_findings
from aatri.checks.after.outside_format import outside_format
from aatri.checks.at_start.mark_numbers import mark_numbers
from aatri.checks.finding import report
from aatri.checks.limits import PHOTO_MARGIN
from aatri.orientation.interior.film_deformation import without_deformation
from aatri.plugin import Context, Field, Options


class FiducialOptions(Options):
    """Options of the interior orientation by fiducial marks."""

    test_limit: float = Field(
        4.0, gt=0, description="a fiducial mark with a larger test statistic is rejected, in standard deviations"
    )
    max_sigma0: float = Field(MAX_SIGMA0, gt=0, description="an image whose sigma0 is larger is not used")


def oriented_film(block: Block, model: str, options: FiducialOptions, context: Context) -> ImagePoints:
    """Photo coordinates of film by fiducial marks; of other images by calibration.

    Parameters
    ----------
    model : str
        One of `geometry.plane_transformations.PARAMETERS`.
    """
    film = film_images(block)
    if not film.any():
        context.log("no film image with comparator or pixel coordinates: no fiducial marks are needed")
    marks = film_marks(block, np.flatnonzero(film))
    report(mark_numbers(block, marks), context)
    fit = snooped_marks(marks, model, limit=options.test_limit)
    unusable = unusable_film(marks, fit, options.max_sigma0)
    report(film_findings(block, marks, fit, unusable), context)
    fit = of_usable(fit, unusable)
    usable, nominal = fit.determined, np.einsum("nii->ni", marks.nominal)
    calibrated = calibrated_interior(block, np.flatnonzero(block.images.active & ~film))
    interior = stacked([calibrated, film_interior(marks, fit)])
    undeformed = None
    if film.any():
        undeformed = np.full((len(block.images), 2, 3), np.nan)
        undeformed[marks.image[usable]] = without_deformation(
            model, fit.matrix[usable], fit.terms[usable], fit.photo_from_nominal[usable], nominal[usable]
        )
    image_points = image_points_of(
        block,
        interior.take(np.argsort(interior.image, kind="stable")),
        fiducial_residuals=film_residuals(block, marks, fit),
        suspects=film_suspects(block, marks, fit),
        margin=PHOTO_MARGIN,
        film_deformation=undeformed,
    )
    report(outside_format(block, image_points), context)
    return image_points
