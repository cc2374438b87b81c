"""Block adjustment with independent models: seven parameters for every model, all models at once.

    X = T_m + s_m R_m (x + J e_m) + v,      x: points of model m, and its two perspective centres

Models are bodies that are shifted, turned and scaled until their points, their perspective centres and control agree;
ground points and centres are unknowns and eliminated. The centres carry the heights: without them neighbouring models
turn about the row of their common points; observed positions bring them to the ground as control does (but those of
drift groups). Points and centres of a model share the five errors e_m of its relative orientation: latent unknowns with
the covariance in `models` as prior (`centres: {sigma: from_orientation}`). With `centres: {sigma: NUMBER}`, metres on
the ground, the centres have that standard deviation, and the models are rigid, as the classical programs have it.

`unit: double_model` takes two neighbouring models as one rigid body, joined about the image they share.

`iteration: plan_height` adjusts plan (4 unknowns a model) and height (3) in turn, as PAT-M does, with the same result.
Standard deviations of the points are those of this adjustment. `initial` gives the approximate orientations; gross
errors of points and control are searched as in the strip block; the orientations of the images follow by resection on
the adjusted points.

Source: Ackermann, Ebner & Klein 1970; lecture notes A801-A806 (erratum E15: exact derivatives); docs/formulas.md 4.5;
see aatri/orientation/bodies/model_ties.py and independent_models.py.
"""

from typing import Literal, Self

from pydantic import PositiveFloat, field_validator, model_validator

from aatri.adapters.frame.adjustment_frame import in_tangent_frame
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.model_adjustment import ModelAdjustmentOptions, adjusted_models
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.checks.after.of_stage import findings_of
from aatri.checks.finding import report
from aatri.plugin import SILENT, Context, Field, Options, stage


class Centres(Options):
    """The perspective centres of the models."""

    sigma: Literal["from_orientation"] | PositiveFloat = Field(
        "from_orientation",
        description="standard deviation of the perspective centres: from the relative orientations, or a number, m",
    )


class IndependentModelsOptions(ModelAdjustmentOptions):
    """Options of the block adjustment with independent models."""

    centres: Centres = Field(
        Centres(), description="perspective centres as tie points: a mapping with sigma, or the sigma alone"
    )

    unit: Literal["model", "double_model"] = Field(
        "model", description="rigid unit: a model, or two neighbours joined, which want centres.sigma as a number"
    )

    @model_validator(mode="after")
    def _double_models_are_rigid(self) -> Self:
        if self.unit == "double_model" and self.centres.sigma == "from_orientation":
            raise ValueError("double models are rigid: give centres.sigma as a number, m")
        return self

    @field_validator("centres", mode="before")
    @classmethod
    def _sigma_alone(cls, value: object) -> object:
        return {"sigma": value} if isinstance(value, str | float | int) else value


@stage(
    version=2,
    uses=(
        "ground_points.xyz_m",
        "ground_points.covariance_m2",
        "exterior.position_m",
        "cameras.lever_arm_m",
        "earth_curvature:frame",
        "undulation",
    ),
)
def independent_models(
    block: Block,
    image_points: ImagePoints,
    models: Models,
    initial: Solution,
    *,
    options: IndependentModelsOptions = IndependentModelsOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the models of a block together."""
    check_same_block(block, image_points=image_points, models=models, initial=initial)
    sigma = options.centres.sigma
    sigma_m = None if sigma == "from_orientation" else float(sigma)
    inside, double = in_tangent_frame(block, initial), options.unit == "double_model"
    start = inside.initial or initial
    solution, notes = adjusted_models(inside.block, image_points, models, start, options, sigma_m, double)
    report([*notes, *findings_of(inside.block, solution, "model_adjustment", initial.suspects)], context)
    return inside.back(solution)
