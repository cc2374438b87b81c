"""Orientation and set-up of each stereo model for a plotter: base, rotations, epipolar images, pass points, residuals.

    X = X_left + R_model x_model,      y-axes of both epipolar images are parallel, x along the base

Of every stereo pair: the left projection centre and the base on the ground, the rotation of the model, phi, omega and
kappa of both images in it (independent relative orientation), their rotations to epipolar images, the scale number of
the images; of every point its adjusted coordinates, those of its two rays in the model, both epipolar coordinates, the
y-parallax and the residuals on the ground. `aatri export RUN:STAGE tables DIR` writes set_ups.csv and pass_points.csv;
models with y-parallaxes beyond 3 sigma are named. Beside it stand the single models, as of accuracy/evaluation.

Coordinates are those of the adjustment's Cartesian frame. Source: see aatri/evaluation/set_ups.py.
"""

from functools import partial

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_of, points_out_of, solution_into
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Differences, Evaluation, Figures
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.evaluation.alignment import in_frame_of_check
from aatri.evaluation.ray_pairs import ray_pairs
from aatri.evaluation.set_ups import set_ups
from aatri.evaluation.single_models import single_models, with_models
from aatri.ids import several, shown
from aatri.plugin import SILENT, Context, Field, Options, stage


class PlotterOptions(Options):
    """Options of the set-ups."""

    warn_beyond: float = Field(
        3.0, gt=0, description="models whose points miss each other by more are named: RMS, in standard deviations"
    )


@stage(version=1, uses=())
def plotter(
    block: Block,
    solution: Solution,
    *,
    options: PlotterOptions = PlotterOptions(),
    context: Context = SILENT,
) -> Evaluation:
    """Set up the stereo models of a block.

    Raises
    ------
    InputError
        If no two images of the solution make a model.
    """
    frame = frame_of(block)
    poses, xyz_m = solution_into(frame, solution)
    rays = ray_pairs(block, solution, poses, xyz_m)
    compared = in_frame_of_check(block, solution)
    models = single_models(block, solution, poses, xyz_m, partial(points_out_of, frame), compared=compared)
    if rays is None or models is None:
        raise InputError(
            "no stereo model: no two neighbouring images share six points with residuals",
            where=f"solution ({solution.method})",
            remedy="take the solution of a bundle adjustment",
        )
    made, points = set_ups(block, poses, rays, xyz_m)
    verdict = f"{several(len(made), 'stereo model')} with {several(len(points), 'pass point')}."
    evaluation = Evaluation(
        verdict=verdict, figures=Figures.empty(), differences=Differences.empty(), set_ups=made, pass_points=points
    )
    result = with_models(evaluation, models, compared=compared)
    context.log(result.verdict)
    bad = np.flatnonzero(models.w_rms > options.warn_beyond)
    if len(bad):
        names = [f"{left}-{right}" for left, right in zip(models.left[bad], models.right[bad])]
        context.warn(f"y-parallaxes beyond {options.warn_beyond:g} standard deviations in models {shown(names)}")
    return result
