"""Rank defects: blocks that leave something open, and what is to be said of each; and blocks that leave nothing open.

    python -m tests.campaigns.rank_defects               every defect, with what was said
    python -m tests.campaigns.rank_defects --count 200   good blocks: nothing may be said of them

A defect is a block, options and the words that must stand in what is said: an error, or a warning where the block can
be adjusted without what is open. Kinds of observations that come later add theirs to `DEFECTS`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.codes import CONTROL
from aatri.errors import AatriError
from aatri.progress import Silent
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns import defective_images as images
from tests.campaigns import defective_networks as networks
from tests.campaigns.block_changes import (
    antennas,
    digital,
    everything,
    extreme,
    less_image_points,
    sigmas,
    with_control,
)
from tests.campaigns.good_blocks import good_block

FLAT, AS_PLANNED = images.FLAT, images.PLANNED


@dataclass(frozen=True)
class Defect:
    """A block that leaves something open.

    Attributes
    ----------
    make : callable
        () -> block, options.
    words : tuple of str
        All of them must stand in what is said.
    refused : bool
        It is an error; else a warning, and the rest is adjusted.
    """

    make: Callable[[], tuple[Block, BundleOptions]]
    words: tuple[str, ...]
    refused: bool = True


def _options(**more: Any) -> BundleOptions:
    return BundleOptions(**more)


def _none() -> tuple[Block, BundleOptions]:
    return with_control(digital(), lambda xyz: np.zeros(0, int)), _options()


def _heights_only() -> tuple[Block, BundleOptions]:
    return with_control(digital(), everything, (2,)), _options()


def _two_points() -> tuple[Block, BundleOptions]:
    return with_control(digital(), extreme(2)), _options()


def _collinear() -> tuple[Block, BundleOptions]:
    """Four control points on the western edge."""
    block = images.flown()
    xyz = block.ground_points.xyz_m[(block.ground_points.role == CONTROL).any(axis=1)]
    west = np.flatnonzero(xyz[:, 0] < xyz[:, 0].min() + 1.0)
    return images.with_roles(block, dict.fromkeys(west.tolist(), (1, 1, 1))), _options()


def _one_ray() -> tuple[Block, BundleOptions]:
    block = digital()
    new = np.setdiff1d(np.unique(block.image_points.point), block.ground_points.point)[5]
    mine = np.flatnonzero(block.image_points.point == new)
    keep = np.ones(len(block.image_points), dtype=bool)
    keep[mine[1:]] = False
    return less_image_points(block, keep), _options()


def _image_of_two_points() -> tuple[Block, BundleOptions]:
    block = digital()
    mine = np.flatnonzero(block.image_points.image == 4)
    keep = np.ones(len(block.image_points), dtype=bool)
    keep[mine[2:]] = False
    return less_image_points(block, keep), _options()


def _disconnected() -> tuple[Block, BundleOptions]:
    """Strips 1 and 3 have no points in common, and all control is in one of them."""
    block = digital(flight={"side_overlap": 30.0})
    points, strip = block.image_points, block.images.strip
    of = strip[points.image]
    both = np.intersect1d(points.point[of == 0], points.point[of != 0])
    keep = ~((of != 0) & np.isin(points.point, both))
    block = less_image_points(block, keep)
    mine = np.setdiff1d(points.point[of == 0], points.point[(of != 0) & keep])
    ground = block.ground_points.point
    return with_control(
        block, lambda xyz: np.flatnonzero(np.isin(ground[(block.ground_points.role == CONTROL).any(axis=1)], mine))
    ), _options()


def _unused_camera() -> tuple[Block, BundleOptions]:
    block = digital()
    cameras = block.cameras
    twice = {name: np.repeat(getattr(cameras, name), 2, axis=0) for name in cameras.__dataclass_fields__}
    twice["id"] = np.array(["rc30", "spare"])
    block = sigmas(replace(block, cameras=type(cameras)(**twice)), ("principal_distance",))
    p = block.camera_parameters
    return replace(block, camera_parameters=replace(p, camera=np.array([1], np.int32))), _options()


def _distance_of_vertical_images() -> tuple[Block, BundleOptions]:
    block = digital(terrain=FLAT, flight=AS_PLANNED)
    return sigmas(with_control(block, extreme(4)), ("principal_distance",)), _options()


def _lever_and_distance() -> tuple[Block, BundleOptions]:
    """Flat and vertical: c moves the flying height over the control, and the lever arm the positions with it."""
    block = digital(gnss=True, terrain=FLAT, flight=AS_PLANNED)
    return sigmas(antennas(block), ("lever_arm.z", "principal_distance")), _options()


def _lever_and_shift() -> tuple[Block, BundleOptions]:
    block = digital(gnss=True, flight=AS_PLANNED)
    return sigmas(antennas(block), ("lever_arm.z",)), _options(positions={"drift": "shift", "per": "block"})


def _distance_and_shift() -> tuple[Block, BundleOptions]:
    block = digital(gnss=True, terrain=FLAT, flight=AS_PLANNED)
    return sigmas(block, ("principal_distance",)), _options(positions={"drift": "shift", "per": "block"})


def _arm_and_time() -> tuple[Block, BundleOptions]:
    block = digital(gnss=True, flight=AS_PLANNED)
    return sigmas(antennas(block), ("lever_arm.x",)), _options(positions={"time_offset": True})


DATUM = ("shift X", "shift Y", "shift Z", "rotation about X", "rotation about Y", "rotation about Z")

DEFECTS = {
    "no datum": Defect(_none, ("7 unknown", "scale", *DATUM, "of the whole block", "give control")),
    "control in height only": Defect(
        _heights_only, ("3 unknown", "rotation about Z, shift X, shift Y of the whole block")
    ),
    "two control points": Defect(_two_points, ("1 unknown", "rotation about the axis", "on one line")),
    "control points on a line": Defect(_collinear, ("1 ", "rotation about Y of the whole block", "on one line")),
    "one distance and no control": Defect(networks.one_distance_for_a_datum, ("6 unknown", *DATUM, "whole block")),
    "two blocks that nothing connects": Defect(
        _disconnected, ("set aside, its observations do not determine it", "image 02"), refused=False
    ),
    "a point in one image": Defect(_one_ray, ("too few usable rays (1 of",), refused=False),
    "an image of two points": Defect(_image_of_two_points, ("too few points (1 of 15 images)",), refused=False),
    "a camera of no image": Defect(_unused_camera, ("nothing in use observes them", "spare"), refused=False),
    "principal distance, flat and vertical": Defect(
        _distance_of_vertical_images, ("1 unknown", "principal_distance", "Z0")
    ),
    "k1, flat and vertical": Defect(images.k1_of_a_vertical_strip, ("k1 and Z0", "told apart", "bowl"), refused=False),
    "lever arm z and principal distance": Defect(
        _lever_and_distance,
        ("leave 1", "lever z", "principal_distance"),  # open or nearly so: rounding decides
    ),
    "lever arm z and shift Z": Defect(_lever_and_shift, ("1 unknown", "shift Z", "lever z")),
    "principal distance and shift Z": Defect(_distance_and_shift, ("1 combination", "principal_distance", "shift Z")),
    "lever arm x, time offset": Defect(_arm_and_time, ("lever x of", "time offset", "told apart"), refused=False),
    "principal point and boresight": Defect(
        images.principal_point_and_boresight, ("principal_point.y", "boresight x", "0.9"), refused=False
    ),
    "boresight about z without positions": Defect(
        images.boresight_about_z, ("1 combination", "rotation about Z of the whole block with boresight z")
    ),
    "a free mount seen once": Defect(
        images.mount_seen_once,
        ("set aside, its observations do not determine it", "0101oblique", "mount R/oblique"),
        refused=False,
    ),
    "drift of strips without cross strips": Defect(
        images.drift_of_strips, ("shift Z of 4", "no cross strips"), refused=False
    ),
    "directions without orientation": Defect(networks.unoriented_set, ("1 unknown", "rotation about Z", "azimuth")),
    "a set of one direction": Defect(networks.set_of_one, ("single direction", "S1"), refused=False),
    "a station with distances in its plane": Defect(
        networks.distances_in_a_plane, ("1 combination", "open: Z", "of point S")
    ),
    "a plane network without distance": Defect(
        networks.plan_without_distance, ("1 unknown", "scale of the whole", "size")
    ),
    "a plane through collinear points": Defect(
        networks.plane_of_collinear_points, ("hardly determine", "plane 1, 2, 3, 4"), refused=False
    ),
    "a point of an exact plane alone": Defect(
        networks.point_of_a_plane_alone, ("too few usable rays (1 of", "4"), refused=False
    ),
}


class Heard(Silent):
    """Keeps the warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warn(self, message: str) -> None:
        self.warnings.append(message)


def said_of(block: Block, options: BundleOptions) -> tuple[bool, str]:
    """Whether a block is refused, and what is said: the error, or all warnings."""
    heard = Heard()
    try:
        bundle(block, calibrated(block) if len(block.images) else None, options=options, context=heard)
    except AatriError as error:
        return True, f"{error} {error.remedy}"
    return False, "\n".join(heard.warnings)


DEFECTIVE = ("open", "determined", "told apart", "left out", "observes them", "set aside")
"""Words of a rank defect; correlations below 0.999 are told without them, and are none."""


def defects_told(defects: dict[str, Defect] = DEFECTS) -> list[tuple[bool, str]]:
    """Of each defect whether it is named, and what is said."""
    lines = []
    for name, defect in defects.items():
        refused, said = said_of(*defect.make())
        ok = refused == defect.refused and all(word in said for word in defect.words)
        lines.append((ok, f"{name}: {'refused' if refused else 'adjusted'}: {said[:400]}"))
    return lines


def main(count: int) -> int:
    lines = defects_told()
    for ok, text in lines:
        print(f"{'ok   ' if ok else 'WRONG'} {text}", flush=True)  # noqa: T201
    alarms = 0
    for seed in range(1, count + 1):
        refused, said = said_of(*good_block(seed))
        if refused or any(word in said for word in DEFECTIVE):
            alarms += 1
            print(f"WRONG good block {seed}: {said[:400]}", flush=True)  # noqa: T201
    named = f"{sum(ok for ok, _ in lines)} of {len(lines)} defects named"
    print(f"{named}, {alarms} of {count} good blocks with a false alarm")  # noqa: T201
    return 0 if all(ok for ok, _ in lines) and not alarms else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=0)
    raise SystemExit(main(parser.parse_args().count))
