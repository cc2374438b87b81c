"""A group: observations that are wrong together, how, and what that does to the result.

That is the bias of its coordinates, in standard deviations of them.

Source: Baarda 1968, A testing procedure for use in geodetic networks (external reliability).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aatri.adjustment.covariance.score import moved, with_factor
from aatri.arrays import Float, Int
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import LINE, STRIP, BundleInput
from aatri.orientation.bundle.result import BundleResult


@dataclass(frozen=True)
class Group:
    """Observations that are wrong together, and how."""

    place: int
    """Of their kind among the observations."""
    kind: str
    per: str
    unit: str
    cause: str
    """As of its `Candidates`."""
    rows: Int
    """(n,)."""
    H: Float
    """(n, m, k). Derivatives of their residuals by the parameters of the cause."""
    value: Float
    sigma: Float
    """(k,). Parameters, in units of the kind; a posteriori where sigma0 is above 1."""
    gain: float
    """By which they reduce v'v, over s^2."""
    sigma0: float
    """With the parameters."""
    harm: float = 0.0
    """Largest change of a coordinate of a point or of a projection centre, in its standard deviations."""
    change_m: float = 0.0
    """That change; of a point where one changes by more than its standard deviation."""
    moved: str = ""
    """What changes so."""
    or_else: tuple[tuple[str, str, str], ...] = ()
    """Unit's kind, unit and cause of others that explain as much."""
    undecided: Int = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(j,). Rows of other units of the same kind that explain as much."""
    c_mm: float = float("nan")
    """Principal distance of its image points."""
    loosens: bool = False
    """See `Cause`."""
    removable: bool = False
    """It may be left out."""
    rejected: Int = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(r,). Rows of the unit that are not in use."""
    H_of_rejected: Float | None = None
    """(r, m, k)."""

    @property
    def complexity(self) -> tuple[bool, bool, int]:
        """Of what explains as much the least is taken: cameras of a strip are rare; a camera; the fewest parameters."""
        if self.loosens:
            return False, False, 0
        of_image = self.kind == IMAGE_POINT
        return of_image and self.per in (STRIP, LINE), of_image, len(self.value)

    @property
    def factor(self) -> float:
        """Principal distance of the block over the one that is asked for: the correction is of measured coordinates."""
        return 1.0 - float(self.value[0]) / self.c_mm if self.cause == "principal distance" else 1.0

    @property
    def effect(self) -> Float:
        """Part of the residuals of its rows, (n, m)."""
        return self.H @ self.value


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
