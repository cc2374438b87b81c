"""A block in four parts, each adjusted by itself and joined by reduced normal equations, against the joint adjustment.

    python -m tests.campaigns.merged_blocks --strips 25 --images 40

Preset `uav` with few points and observed attitudes, cut in four along and across its strips: no image is in two parts.
Each line: the largest difference of positions and points from the joint adjustment in its standard deviations, first
with every part linearised at its own adjustment, then where all parts together are. Rays of points that a part sees
once stay in the equations of that part, so that none is lost. Last the same with one control point 0.1 m off in the
first part alone, which must be refused by the name of the point.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from aatri.artifacts.block import CONTROL, Block
from aatri.errors import AatriError
from aatri.formats.merging.part import part_of
from tests.stages.chain import simulated
from tests.stages.information.test_parts import chain, start_of
from tests.stages.information.test_reduced import OF_SIGMA, adjusted, apart


def block_in_four(strips: int, images: int, points_per_image: int, seed: int = 1) -> tuple[Block, list[Block]]:
    """A block and its four parts; control on the cuts is in several of them."""
    flight = {"strips": strips, "images_per_strip": images}
    ties = {"random_per_image": float(points_per_image)}
    block = simulated(seed, preset="uav", flight=flight, ties=ties, imu={"observed": True})
    along = np.arange(len(block.images)) % images >= images // 2
    return block, [part_of(block, (2 * (block.images.strip >= strips // 2) + along) == k) for k in range(4)]


def shifted_control(parts: list[Block]) -> tuple[list[Block], str]:
    """The parts with a control point of the first one 0.1 m off that another part has too, and its id."""
    first, *others = parts
    ground, ids = first.ground_points, first.points.id
    elsewhere = {str(name) for part in others for name in part.points.id[part.ground_points.point]}
    is_control = (ground.role == CONTROL).any(axis=1)
    row = next(k for k in np.flatnonzero(is_control) if str(ids[ground.point[k]]) in elsewhere)
    xyz_m = ground.xyz_m.copy()
    xyz_m[row, 0] += 0.1
    return [replace(first, ground_points=replace(ground, xyz_m=xyz_m)), *others], str(ids[ground.point[row]])


def told(strips: int, images: int, points_per_image: int) -> Iterator[str]:
    """What merging gives."""
    block, parts = block_in_four(strips, images, points_per_image)
    joint = adjusted(block)
    sizes = ", ".join(f"{len(part.images)} images with {len(part.points)} points" for part in parts)
    yield f"{len(block.images)} images, {len(block.points)} points, {len(block.image_points)} image points; {sizes}"
    once = chain(parts, [None] * len(parts))
    yield f"each at its own adjustment: {apart(once, joint):.2g} sigma"
    again = chain(parts, [start_of(part, joint) for part in parts], at_initial=True)
    ratio, largest = again.sigma0 / joint.sigma0 - 1, apart(again, joint)
    equal = largest < OF_SIGMA and again.redundancy == joint.redundancy
    yield f"{'' if equal else 'WRONG: '}all at one place: {largest:.2g} sigma, sigma0 {ratio:.1g} of itself apart"
    wrong, name = shifted_control(parts)
    try:
        chain(wrong, [None] * len(wrong))
    except AatriError as error:
        yield f"control {name} off in one part: {error}" if name in str(error) else f"WRONG: {error}"
    else:
        yield f"WRONG: control {name} off in one part was not refused"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=25)
    parser.add_argument("--images", type=int, default=40, help="per strip")
    parser.add_argument("--points", type=int, default=12, help="per image")
    wanted = parser.parse_args()
    wrong = False
    for line in told(wanted.strips, wanted.images, wanted.points):
        print(line, flush=True)  # noqa: T201
        wrong |= line.startswith("WRONG")
    raise SystemExit(wrong)
