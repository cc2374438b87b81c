"""Control points that no strip holds, by the rays of a component's images.

A point that two images of different strips see lies in no model, nor does one whose model has rejected it; where it is
control, the datum may hang on it. Its rays are intersected in the frame of the component, each with the uncertainty of
its image there. A ray that does not meet the others is left out, if it is clear which: of three rays the pair that
remains must meet clearly better than both others. Which rays meet is then known better than from a single model.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.limits import UNCERTAIN_DISTANCE
from aatri.adjusting.uncertain_intersection import UncertainIntersection, intersect_uncertain
from aatri.arrays import Float, Int, finite_rows
from aatri.observations.image_point_rows import ImagePointRows, residuals_mm
from aatri.observations.poses import POSE
from aatri.orientation.bodies.components import Component
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.limits import CLEARLY_LIKELIER


@dataclass(frozen=True)
class ControlByRays:
    """A component with the control points that its rays determine."""

    component: Component
    body: FreeBody
    """The same as a body."""
    meeting: Int
    apart: Int
    """(k,). Rows of the rays that meet in these points, and of those that do not."""
    apart_mm: Float
    """(k,), mm. By how much; NaN where the point lies behind the image."""


def control_by_rays(
    component: Component, body: FreeBody, lacking: Int, rays: ImagePointRows, limit: float
) -> ControlByRays:
    """Intersect the control points that a component lacks.

    Parameters
    ----------
    body : FreeBody
        The same as a body.
    lacking : (n,) int
        Rows of these control points in points.
    rays : ImagePointRows
        Of all images.
    limit : float
        Test statistic of rays that do not meet. Points as uncertain as one at infinity stay out.
    """
    rows = np.flatnonzero(rays.active & body.has[POSE][rays.image] & np.isin(rays.point, lacking))
    if not len(rows):
        return ControlByRays(component, body, rows, rows, np.zeros(0))
    xyz, covariance = body.xyz.copy(), body.covariance.copy()
    meeting: list[Int] = [np.zeros(0, dtype=np.int64)]
    for point in np.unique(rays.point[rows]):
        meeting_rows, met = _met(body, rays, rows[rays.point[rows] == point], limit)
        if not len(meeting_rows):
            continue
        nearest = np.linalg.norm(body.poses.position_m[rays.image[meeting_rows]] - met.xyz_m[0], axis=1).min()
        if np.sqrt(np.trace(met.covariance_m2[0])) < UNCERTAIN_DISTANCE * nearest:
            xyz[point], covariance[point] = met.xyz_m[0], met.covariance_m2[0]
            meeting.append(meeting_rows)
    points, met_rows = np.flatnonzero(finite_rows(xyz)), np.concatenate(meeting)
    apart = np.setdiff1d(rows[np.isin(rays.point[rows], rays.point[met_rows])], met_rows)
    apart_mm = residuals_mm(rays, apart, body.poses, xyz)
    return ControlByRays(
        replace(component, point=points, xyz=xyz[points], covariance=covariance[points]),
        replace(body, xyz=xyz, covariance=covariance),
        met_rows,
        apart,
        np.where(np.isfinite(apart_mm), apart_mm, np.nan),
    )


def _met(body: FreeBody, rays: ImagePointRows, rows: Int, limit: float) -> tuple[Int, UncertainIntersection]:
    """The rays of one point that meet, and where; none if it is not clear which do."""
    met = _intersected(body, rays, rows)
    while len(rows) and _misfit(met) > limit:
        each = [_intersected(body, rays, np.delete(rows, k)) for k in range(len(rows))]
        misfits = np.array([_misfit(one) for one in each])
        first, *others = np.argsort(misfits).tolist()
        if not np.isfinite(misfits[first]):  # of two rays none is left
            return rows[:0], met
        if len(rows) == 3 and misfits[others[0]] ** 2 - misfits[first] ** 2 <= CLEARLY_LIKELIER:
            return rows[:0], met
        rows, met = np.delete(rows, first), each[first]
    return rows, met


def _intersected(body: FreeBody, rays: ImagePointRows, rows: Int) -> UncertainIntersection:
    n = len(body.poses.position_m)
    covariance = np.zeros((n, 6, 6))
    covariance[:, :3, :3], covariance[:, 3:, 3:] = body.centre_covariance, body.turn_rad**2 * np.eye(3)
    of_point = replace(
        rays.take(rows), point=np.zeros(len(rows), dtype=np.int64), active=np.ones(len(rows), dtype=bool)
    )
    return intersect_uncertain(of_point, body.poses, covariance, 1)


def _misfit(met: UncertainIntersection) -> float:
    """Root of the sum of squares of the whitened residuals over their redundancy; infinite where nothing meets."""
    redundancy = 2 * int(met.used.sum()) - 3
    if redundancy < 1 or not np.isfinite(met.xyz_m).all():
        return float("inf")
    return float(np.sqrt(np.nansum(met.whitened**2) / redundancy))
