"""Model coordinates, as a plotter measured or a textbook prints them: stereo models without images, control beside.

Each model has axes and a unit of its own, Z upwards; perspective centres may be among its points. For
model_adjustment/given_models: of one model that is its absolute orientation, of several the block adjustment with
independent models. The form of the files is described in docs/formats.md.
"""

from typing import Literal

import numpy as np

from aatri.artifacts.block import CONTROL, Block
from aatri.checks.as_read.values import wrong_values
from aatri.checks.finding import report
from aatri.formats.edits.edited import edited
from aatri.formats.pairs.reader import read_models
from aatri.ids import several, shown
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import EditOptions


class ModelsOptions(EditOptions):
    """Options of block/models."""

    path: InputPath = Field(description="file of lines: model point X Y Z, then perhaps sigma, and `centre`")
    control: InputPath | None = Field(None, description="control points: point X Y Z, m; null: none")
    check: InputPath | None = Field(None, description="check points: point X Y Z, m; null: none")
    axes: Literal["east,north,up", "north,east,up"] = Field(
        "east,north,up", description="what X and Y of control and check points are"
    )
    sigma: float = Field(0.01, gt=0, description="standard deviation of model coordinates, in their unit")
    centre_sigma: float | None = Field(None, gt=0, description="that of perspective centres; null: as of other points")
    control_sigma: float | None = Field(None, gt=0, description="standard deviation of control points, m; null: exact")


@stage(version=1, uses=())
def models(*, options: ModelsOptions, context: Context = SILENT) -> Block:
    """Read model coordinates."""
    block = read_models(
        options.path,
        sigma=options.sigma,
        centre_sigma=options.centre_sigma,
        axes=options.axes,
        control=options.control,
        check=options.check,
        control_sigma_m=options.control_sigma or 0.0,
        reporter=context,
    )
    block = edited(block, options.edits, context)
    report(wrong_values(block), context)
    assert block.model_coordinates is not None
    models_xyz = block.model_coordinates
    used = block.ground_points.point[block.ground_points.given_as(CONTROL)]
    unseen = block.points.id[np.setdiff1d(used, models_xyz.point)]
    if len(unseen):
        context.warn(f"control in no model: {shown(unseen.tolist())}; are the names of its points others there?")
    context.log(
        f"{several(len(np.unique(models_xyz.model)), 'model')}, {several(len(models_xyz), 'point')} in "
        f"them, {several(len(used), 'control point')}"
    )
    return block
