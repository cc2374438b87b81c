"""A bundle: the checks of this room, in their order.

Seen: what the other files of this room look for.
Test: sigma0 of kinds only where the search has not estimated standard deviations, and no group explains them.
"""

import numpy as np

from aatri.checks.after.at_infinity import points_at_infinity
from aatri.checks.after.correlations import high_correlations
from aatri.checks.after.error_budget import error_budget
from aatri.checks.after.exchanged_marks import exchanged_marks
from aatri.checks.after.few_rays import points_of_few_rays
from aatri.checks.after.groups import contradicts, wrong_groups
from aatri.checks.after.hidden_distortion import hidden_distortion
from aatri.checks.after.hinge_image import hinge_images
from aatri.checks.after.left_out import left_out, left_out_alike, lengths_in_other_units
from aatri.checks.after.parameters import moved_cameras, parameter_findings
from aatri.checks.after.rejections import two_objects
from aatri.checks.after.sigma0 import sigma0
from aatri.checks.after.sigmas import more_exact_than_images, sigmas_that_do_not_fit
from aatri.checks.after.terrain import points_off_the_terrain
from aatri.checks.after.weak_datum import weak_datum
from aatri.checks.at_start.attitude_convention import attitude_conventions
from aatri.checks.at_start.orientations import turned_over
from aatri.checks.finding import Finding
from aatri.notes import Note
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE
from aatri.orientation.bundle.groups.search import AcceptedGroup
from aatri.orientation.bundle.parameter_estimates import column_kinds
from aatri.orientation.bundle.rounds import AdjustedBlock


def findings_after(
    source: ObservationSource,
    done: AdjustedBlock,
    groups: tuple[AcceptedGroup, ...],
    max_sigma0: float | None,
    *,
    tests: bool,
    searched: bool,
) -> list[Finding | Note]:
    """What an adjusted block shows; what the methods noted on the way stands after its groups.

    Parameters
    ----------
    source : ObservationSource
        What the observations of the block were taken from.
    done : AdjustedBlock
        Without covariances where none are wanted.
    tests : bool
        Observations are tested too.
    searched : bool
        Gross errors were looked for.
    """
    inputs, result = done.inputs, done.result
    images, cameras = source.block.images, source.block.cameras
    arms, boresights = (
        dict(zip(cameras.id.tolist(), values)) for values in (cameras.lever_arm_m, cameras.boresight_rad)
    )
    moved = moved_cameras(result)
    named = wrong_groups(groups, arms, boresights, moved)
    wrong = [one for one in groups if contradicts(one, moved)]
    explained = done.scale != 1.0 or bool(wrong)
    cause = next((group for group in named if group.contradicts), None)
    carried = [one.group.sigma0 for one in wrong if not one.left_out]
    with_cause = min(carried, default=np.inf)
    sigma_rad = 0.0 if inputs.rays is None else inputs.rays.sigma_rad
    return [
        *turned_over(source.start[POSE], result.poses, images.camera, cameras.id),
        *named,
        *attitude_conventions(source, inputs, result.adjusted.state, before=False),
        *two_objects(inputs.rays, inputs.image_ids, inputs.point_ids, result, done.scale),
        *done.notes,
        *result.notes,
        *([] if wrong else left_out_alike(result, {one.group.kind for one in groups if one.left_out})),
        *left_out(inputs, result),
        *lengths_in_other_units(result),
        *points_at_infinity(inputs, result),
        *points_of_few_rays(result),
        *exchanged_marks(source.block, source.image_points, result.poses, result.xyz_m),
        *sigma0(result, max_sigma0, done.scale, cause, with_cause=with_cause, searched=searched, sigma_rad=sigma_rad),
        *([] if explained else sigmas_that_do_not_fit(result)),
        *more_exact_than_images(inputs, result, done.scale),
        *weak_datum(inputs, result, done.scale),
        *error_budget(source.block, result),
        *hinge_images(inputs),
        *points_off_the_terrain(inputs, result),
        *hidden_distortion(source, result, tests=tests),
        *parameter_findings(inputs, result),
        *high_correlations(result, column_kinds(inputs)),
    ]
