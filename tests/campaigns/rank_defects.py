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
from aatri.codes import ANTENNA, CONTROL, NO_ROLE
from aatri.errors import AatriError
from aatri.geometry.rotations import angles_from_rotation
from aatri.progress import Silent
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.chain import simulated

FLAT = {"mean_height_m": 0.0, "relief_m": 0.0}
AS_PLANNED = {"position_sigma_m": (0.0, 0.0, 0.0), "tilt_sigma_deg": 0.0, "tilt_max_deg": 0.0, "kappa_sigma_deg": 0.0}


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


def digital(seed: int = 3, *, gnss: bool = False, **more: Any) -> Block:
    """A small block of digital images; positions are approximate unless they are wanted as observations."""
    given: dict[str, Any] = {
        "preset": "rc30", "flight": {"strips": 3, "images_per_strip": 5, "cross_strips": 0},
        "camera": {"kind": "digital", "distortion": "none", "format": (20000.0, 20000.0), "pixel_size_mm": 0.0115},
        "earth": "flat", "refraction": "none", "ties": {"new_points": 120}, "known": {"full": 12},
        "gnss": {"observed": gnss},
    }  # fmt: skip
    for name, value in more.items():
        given[name] = {**given[name], **value} if isinstance(given.get(name), dict) else value
    return with_approximate_angles(simulated(seed, **given))


def with_approximate_angles(block: Block) -> Block:
    """Angles of the truth as start values, so that no start has to be found."""
    truth, e = block.true_images, block.exterior
    assert truth is not None
    R = np.empty((len(block.images), 3, 3))
    R[truth.image] = truth.ground_from_image
    angles = angles_from_rotation(R[e.image], block.rotation)  # type: ignore[arg-type]
    return replace(block, exterior=replace(e, angles_rad=angles))


def with_control(block: Block, keep: Callable[[np.ndarray], np.ndarray], axes: tuple[int, ...] = (0, 1, 2)) -> Block:
    """The block with some of its control points, in some coordinates; the others are new points."""
    g = block.ground_points
    control = np.flatnonzero((g.role == CONTROL).any(axis=1))
    kept = np.zeros(len(g), dtype=bool)
    kept[control[keep(g.xyz_m[control])]] = True
    role = np.where(kept[:, None] & np.isin(np.arange(3), axes), CONTROL, NO_ROLE).astype(np.int32)
    return replace(block, ground_points=replace(g, role=role))


def extreme(count: int) -> Callable[[np.ndarray], np.ndarray]:
    """The points nearest to so many corners."""

    def keep(xyz: np.ndarray) -> np.ndarray:
        corners = np.array([[-1, -1], [1, 1], [1, -1], [-1, 1]])[:count]
        centred = xyz[:, :2] - xyz[:, :2].mean(axis=0)
        return np.unique([int(np.argmax(centred @ c)) for c in corners])

    return keep


def everything(xyz: np.ndarray) -> np.ndarray:
    """All of them."""
    return np.arange(len(xyz))


def sigmas(block: Block, free: tuple[str, ...]) -> Block:
    """With some camera parameters free."""
    n, p = len(free), block.camera_parameters
    rows = {
        "camera": np.zeros(n, np.int32), "name": np.array(free), "value": np.full(n, np.nan),
        "sigma": np.full(n, np.nan), "free": np.ones(n, bool),
    }  # fmt: skip
    return replace(block, camera_parameters=type(p)(**rows))


def antennas(block: Block) -> Block:
    """Observed positions are those of antennas."""
    return replace(block, exterior=replace(block.exterior, refers_to=np.full(len(block.exterior), ANTENNA, np.int32)))


def less_image_points(block: Block, keep: np.ndarray) -> Block:
    """Some image points switched off."""
    points = block.image_points
    return replace(block, image_points=replace(points, active=points.active & keep))


def _options(**more: Any) -> BundleOptions:
    return BundleOptions(**more)


def _none() -> tuple[Block, BundleOptions]:
    return with_control(digital(), lambda xyz: np.zeros(0, int)), _options()


def _heights_only() -> tuple[Block, BundleOptions]:
    return with_control(digital(), everything, (2,)), _options()


def _two_points() -> tuple[Block, BundleOptions]:
    return with_control(digital(), extreme(2)), _options()


def _collinear() -> tuple[Block, BundleOptions]:
    """Three control points on a line: the ends, and the point next to the line moved onto it in the observations."""
    block = with_control(digital(terrain=FLAT), extreme(4))
    g = block.ground_points
    rows = np.flatnonzero((g.role == CONTROL).any(axis=1))
    x = g.xyz_m[rows, 0]
    ends = rows[[int(np.argmin(x)), int(np.argmax(x))]]
    role = np.zeros_like(g.role)
    role[ends] = CONTROL
    return replace(block, ground_points=replace(g, role=role)), _options()


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


DEFECTS = {
    "no datum": Defect(_none, ("7 unknown",)),
    "control in height only": Defect(_heights_only, ("3 unknown", "X0", "Y0")),
    "two control points": Defect(_two_points, ("1 unknown", "rotation about")),
    "control points on a line": Defect(_collinear, ("1 unknown", "rotation about")),
    "a point in one image": Defect(_one_ray, ("too few usable rays (1 of",), refused=False),
    "an image of two points": Defect(_image_of_two_points, ("too few points (1 of 15 images)",), refused=False),
    "two blocks that nothing connects": Defect(_disconnected, ("7 unknown", "image 03")),
    "a camera of no image": Defect(_unused_camera, ("nothing in use observes them", "spare"), refused=False),
    "principal distance, flat and vertical": Defect(_distance_of_vertical_images, ("principal_distance", "Z0")),
    "lever arm z and principal distance": Defect(_lever_and_distance, ("lever z", "principal_distance")),
    "lever arm z and shift Z": Defect(_lever_and_shift, ("lever z", "shift Z")),
    "principal distance and shift Z": Defect(_distance_and_shift, ("principal_distance", "shift Z")),
    "lever arm x, time offset": Defect(_arm_and_time, ("lever x of", "time offset", "told apart"), refused=False),
}  # fmt: skip
"""Beside these `ackermann` has the drift of strips without cross strips."""


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
        bundle(block, calibrated(block), options=options, context=heard)
    except AatriError as error:
        return True, f"{error} {error.remedy}"
    return False, "\n".join(heard.warnings)


def good_block(seed: int) -> tuple[Block, BundleOptions]:
    """A block that leaves nothing open: relief, control at the corners and inside; every second one with positions."""
    rng = np.random.default_rng(seed)
    flight = {"strips": int(rng.integers(2, 5)), "images_per_strip": int(rng.integers(4, 8)), "cross_strips": seed % 2}
    block = digital(seed, gnss=bool(seed % 2), flight=flight, known={"full": int(rng.integers(9, 20))})
    options = [{}, {"positions": {"per": "block"}}, {}, {"positions": {"drift": "shift", "per": "strip"}}][seed % 4]
    return block, _options(**options)


DEFECTIVE = ("open", "determined", "told apart", "separat", "left out", "observes them")
"""Words of a rank defect."""


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
