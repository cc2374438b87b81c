"""Absolute orientation and block adjustment of models given by coordinates, without images (block/models).

    X = T_m + s_m R_m x + v,      x: points of model m, perspective centres among them

One model goes to its control by seven parameters, with their standard deviations: the absolute orientation of the
textbooks. Several are joined by common points - each keeps its own coordinates, none are averaged - and adjusted
together: the block adjustment with independent models. Residuals are those of every point in every model.

Reduced to the centroid of each model the normal equations of shift, rotation and scale fall apart; see
absolute_orientation/similarity, `start: centroids`.

Source: Ackermann, Ebner & Klein 1970; Kraus, Photogrammetry; lecture notes A503, A801-A806.
"""

from aatri.adapters.strips.model_adjustment import ModelAdjustmentOptions, adjusted_given_models
from aatri.artifacts.block import Block
from aatri.artifacts.needed_datum import datum_needed
from aatri.artifacts.solution import Solution
from aatri.checks.after.mirrored_models import mirrored_models
from aatri.checks.after.model_units import models_of_another_unit
from aatri.checks.finding import report
from aatri.errors import ConvergenceError, GeometryError
from aatri.plugin import SILENT, Context, stage


@stage(
    version=1,
    uses=("ground_points.xyz_m", "ground_points.covariance_m2", "model_coordinates.xyz"),
    needs=datum_needed(positions=False),
)
def given_models(
    block: Block,
    *,
    options: ModelAdjustmentOptions = ModelAdjustmentOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust models given by coordinates."""
    try:
        solution, notes = adjusted_given_models(block, options)
    except (ConvergenceError, GeometryError) as failure:
        for finding in mirrored_models(block, options, None):
            raise GeometryError(finding.what, remedy=finding.remedy) from failure
        raise
    mirrored = mirrored_models(block, options, solution)
    report([*notes, *mirrored, *models_of_another_unit(block, solution)], context)
    return solution
