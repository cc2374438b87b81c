"""Control points with each other's number, and images with each other's position, as a start shows them.

Seen: image a lies at the position given for b, and b at that of a; or the rays of two control points meet where the
other is given. Such a pair is left out before anything is adjusted, of images with all that is observed of them,
positions and attitudes: metres of contradiction would bend everything else, or come to no end. What the search for
gross errors says of it, and whether it comes back, follows from the adjustment without. A start that was made of the
positions themselves says nothing.
Test: `adjustment.statistics.exchanged`: the start finds each at the coordinates of the other, to a fifth of their
distance, and a quarter of the control where it is given. An error where one of two control points is exact, or fewer
than three others would remain.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.statistics.exchanged import Exchanged, exchanged_at_start
from aatri.arrays import Bool, Float, Int
from aatri.checks.finding import Finding
from aatri.checks.limits import ENOUGH_CONTROL
from aatri.geometry.intersection import intersect_rays
from aatri.observations.control import KIND as CONTROL
from aatri.observations.control import control_of
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.block import BundleInput, start_of
from aatri.units import length


@dataclass(frozen=True)
class ExchangedControl:
    """Two control points that a start finds at each other's coordinates."""

    pair: Exchanged
    rows: Int
    """(2,). Of the control."""
    points: Int
    """(2,)."""
    exact: bool
    """One of them has an exact coordinate."""


def without_exchanged(block: BundleInput) -> BundleInput:
    """The block without exchanged positions, attitudes of their images, and control, as if these had been rejected."""
    images, points = np.zeros(len(block.image_ids), dtype=bool), np.zeros(len(block.point_ids), dtype=bool)
    for pair in exchanged_at_start(block.poses.position_m, _observed_positions(block)):
        images[[pair.first, pair.second]] = True
    for two in exchanged_control_at_start(block):
        points[two.points] = not two.exact
    if not (images.any() or points.any()):
        return block
    return replace(block, observed=tuple(_without(o, images, points) for o in block.observed))


def exchanged_control_at_start(block: BundleInput) -> list[ExchangedControl]:
    """Control points that the rays of the start see at each other's coordinates."""
    control = next((o for o in block.observed if o.kind == CONTROL and o.records.touches[1:] == ()), None)
    rays = block.rays
    if control is None or rays is None:
        return []
    rows = np.flatnonzero(control.records.active)
    points = control.records.touches[0][1][rows]
    place = np.full(len(block.point_ids), -1)
    place[points] = np.arange(len(points))
    seen = np.flatnonzero(rays.active & block.poses.oriented[rays.image] & (place[rays.point] >= 0))
    X0, direction = block.poses.position_m[rays.image[seen]], rays.directions(block.poses, seen)
    seen_m = intersect_rays(X0, direction, place[rays.point[seen]], len(points))
    xyz = np.zeros((len(block.point_ids), 3))
    xyz[points] = np.nan_to_num(seen_m)
    exact = control.demanded()[rows]
    is_observed = control.records.observed_components()[rows] | exact
    given_m = xyz[points] - control.records.evaluate({POINT: xyz}, rows)[0]
    pairs = exchanged_at_start(seen_m, np.where(is_observed, given_m, np.nan))
    both = [(pair, np.array([pair.first, pair.second])) for pair in pairs]
    return [ExchangedControl(pair, control.row[rows[k]], points[k], bool(exact[k].any())) for pair, k in both]


def _observed_positions(block: BundleInput) -> Float:
    """Projection centres by their observed positions, NaN where these are not given in full, (n_images, 3)."""
    observed_m = np.full((len(block.image_ids), 3), np.nan)
    for o in block.observed:
        image = dict(o.records.touches).get(POSE)
        if o.kind == POSITION and image is not None and o.records.rows == 3:
            rows = np.flatnonzero(o.records.active & o.records.observed_components().all(axis=1))
            v, (by_pose, *_) = o.records.evaluate(start_of(block), rows)
            off = np.linalg.solve(by_pose[:, :, :3], v[:, :, None])[:, :, 0]
            observed_m[image[rows]] = block.poses.position_m[image[rows]] - off
    return observed_m


def _without(o: Observed, images: Bool, points: Bool) -> Observed:
    """Without what is observed of one of the images, or given of one of the points."""
    groups = dict(o.records.touches)
    if POSE in groups and POINT not in groups and not (o.exact or o.components):
        rejected = images[groups[POSE]]
    elif o.kind == CONTROL and set(groups) == {POINT}:
        rejected = points[groups[POINT]]
    else:
        return o
    return o.again().without(rejected if o.rejected is None else rejected | o.rejected)


def exchanged_control(source: ObservationSource, inputs: BundleInput) -> list[Finding]:
    """Control points that the start finds at each other's coordinates, and that cannot be left out."""
    block = source.block
    few = int(control_of(block).given.any(axis=1).sum()) - 2 < ENOUGH_CONTROL
    findings = []
    for two in exchanged_control_at_start(inputs):
        if not (few or two.exact):
            continue
        (first, second), pair = block.points.id[two.points].tolist(), two.pair
        text = (
            f"control points {first} and {second} fit with their numbers exchanged, to {length(pair.exchanged_m)}; "
            f"as given they lie {length(pair.as_given_m)} from where the images find them"
        )
        remedy = "exchange the two ids in the control, or in the images"
        where, ratio = block.read_at(block.ground_points, int(two.rows[0])), pair.exchanged_m / pair.as_given_m
        findings.append(
            Finding(
                "exchanged_control", "error", text, remedy, where=where, rows={"control": two.rows}, statistic=ratio
            )
        )
    return findings
