"""What observations that are wrong together do to the coordinates of a result: its bias, in standard deviations of it.

Source: Baarda 1968, A testing procedure for use in geodetic networks (external reliability).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.covariance.score import moved, with_factor
from aatri.arrays import Float
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.result import BundleResult


def with_change(block: BundleInput, result: BundleResult, group: Group, change: dict[str, Float]) -> Group:
    """The group with what a change does to coordinates, those of points first."""
    for name, ids, what in ((POINT, block.point_ids, "point"), (POSE, block.image_ids, "projection centre of image")):
        if name not in change or not len(change[name]):
            continue
        sigma = group.sigma0 * np.sqrt(np.einsum("nii->ni", result.covariances[name])[:, :3])
        by = np.abs(change[name][:, :3])
        ratio = np.divide(by, sigma, out=np.zeros_like(by), where=sigma > 0)
        row, axis = np.unravel_index(int(ratio.argmax()), ratio.shape)
        if ratio[row, axis] > max(group.harm, 1.0) or (name == POINT and ratio[row, axis] > 0):
            harmless, group = group.harm <= 1.0, replace(group, harm=float(ratio[row, axis]))
            if harmless:
                coordinate = f"{'XYZ'[axis]} of {what} {np.asarray(ids)[row]}"
                group = replace(group, change_m=float(by[row, axis]), moved=coordinate)
    return group


def with_harm(block: BundleInput, result: BundleResult, groups: Sequence[Group], out: Sequence[bool]) -> list[Group]:
    """The groups; those that are not left out with what they do, as they are estimated in the end, to the coordinates.

    A test looks one step ahead from where it is made; what a search ends with may have taken up most of an effect, as
    parameters of a camera do that are known beforehand.

    Parameters
    ----------
    result : BundleResult
        Without the unknowns of the groups.
    out : (n,) bool
        Groups that are left out.
    """
    adjusted = result.adjusted
    if all(out) or not adjusted.has_factor:
        return list(groups)
    adjusted = with_factor(replace(adjusted, problem=adjusted.problem.without_lanes()))

    def judged(group: Group) -> Group:
        records = result.observations[group.place].observed.records
        change = moved(adjusted, records, group.rows, group.effect)
        return with_change(block, result, replace(group, harm=0.0, change_m=0.0, moved=""), change)

    return [g if is_out else judged(g) for g, is_out in zip(groups, out)]
