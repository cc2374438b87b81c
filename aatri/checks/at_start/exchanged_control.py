"""Control points with each other's number, which an adjustment could not leave out.

Seen: two control points fit only with their numbers exchanged.
Test: `adjustment.statistics.exchanged`: the start finds each at the coordinates of the other, to a fifth of their
distance, and a quarter of the control where it is given. An error where one of the two is exact, or fewer than three
other points would remain; else the search for gross errors leaves them out and names them.
"""

import numpy as np

from aatri.adapters.imported import read_at
from aatri.adjustment.statistics.exchanged import exchanged_at_start
from aatri.checks.finding import Finding
from aatri.checks.limits import ENOUGH_CONTROL
from aatri.geometry.intersection import intersect_rays
from aatri.observations.control import control_of
from aatri.observations.observed import Given
from aatri.orientation.bundle.block import BundleInput
from aatri.units import length


def exchanged_control(source: Given, given: BundleInput) -> list[Finding]:
    """Control points that the start finds at each other's coordinates, and that cannot be left out."""
    block, frame, rays = source.block, source.frame, given.rays
    control = control_of(block)
    if rays is None:
        return []
    number = np.full(len(block.points), -1)
    number[control.point] = np.arange(len(control.point))
    rows = np.flatnonzero(rays.active & given.poses.oriented[rays.image] & (number[rays.point] >= 0))
    X0, direction = given.poses.position_m[rays.image[rows]], rays.directions(given.poses, rows)
    seen_m = given.origin_m + intersect_rays(X0, direction, number[rays.point[rows]], len(control.point))
    seen_m = seen_m if frame is None else frame.to_block(seen_m)
    few = int(control.given.any(axis=1).sum()) - 2 < ENOUGH_CONTROL
    findings = []
    for pair in exchanged_at_start(seen_m, np.where(control.given, control.xyz_m, np.nan)):
        both = [pair.first, pair.second]
        if not (few or control.exact[both].any()):
            continue
        first, second = block.points.id[control.point[both]].tolist()
        text = (
            f"control points {first} and {second} fit with their numbers exchanged, to {length(pair.exchanged_m)}; "
            f"as given they lie {length(pair.as_given_m)} from where the images find them"
        )
        remedy, of_control = "exchange the two ids in the control, or in the images", {"control": control.row[both]}
        where, ratio = (
            read_at(block, block.ground_points, int(of_control["control"][0])),
            pair.exchanged_m / pair.as_given_m,
        )
        findings.append(
            Finding("exchanged_control", "error", text, remedy, where=where, rows=of_control, statistic=ratio)
        )
    return findings
