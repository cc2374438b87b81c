"""Small legal blocks, with a part that is weak or missing: adjusted by both chains, the part set aside by name."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from tests.small_blocks import C_MM, Small, adjusted_by, flown, off_m, two_apart

BOTH = ("default", "graph")


def changed(small: Small, *changes: Callable[[Small], None]) -> Small:
    for change in changes:
        change(small)
    return small


def no_positions(small: Small) -> None:
    small.observed = {}


def points_left(image: str, count: int) -> Callable[[Small], None]:
    return lambda small: small.without_rays(image, keep=count)


def shuffled(image: str) -> Callable[[Small], None]:
    """All points of an image carry the number of the next one."""

    def change(small: Small) -> None:
        points = small.seen_by(image)
        xy = [small.rays[image, p] for p in points]
        small.rays |= {(image, p): x for p, x in zip(points, [*xy[1:], xy[0]])}

    return change


def star(small: Small) -> None:
    """A point at infinity, in three images."""
    for image in ("101", "102", "103"):
        u = small.rotation[image].T @ np.array([0.05, 0.1, -1.0])
        small.rays[image, "star"] = -C_MM * u[:2] / u[2]


def dust(small: Small) -> None:
    """A speck at the same place in three images."""
    small.rays |= {(image, "dust"): np.array([20.0, -30.0]) for image in ("101", "102", "103")}


def without_datum(small: Small) -> None:
    """The second of two blocks has neither control nor positions."""
    for known in (small.control, small.observed):
        for name in [name for name in known if name.startswith("B")]:
            del known[name]


def unused_camera(small: Small) -> None:
    small.more_cameras = {
        "b": {
            "kind": "digital",
            "image_coordinates": "photo",
            "principal_distance": 80.0,
            "format": [30000, 30000],
            "pixel": {"size": 0.005},
        }
    }


def unseen_control(small: Small) -> None:
    small.xyz_m["far"] = np.array([10.0, 10.0, 10.0])
    small.control["far"] = "XYZ"


def thin_strip(small: Small) -> None:
    """The third strip shares no point with the others, and few within: its orientations are observed."""
    third = [image for image in small.strip if image.startswith("3")]
    for image in third:
        own = [
            p
            for p in small.seen_by(image)
            if all((other, p) not in small.rays for other in set(small.strip) - set(third))
            and sum((other, p) in small.rays for other in third) > 1
        ]
        for point in set(small.seen_by(image)) - set(own[:5]):
            del small.rays[image, point]
    small.attitudes = list(small.strip)


SECOND = ["B101", "B102", "B103", "B201", "B202", "B203"]

BLOCKS: dict[str, tuple[Small, tuple[str, ...], list[str], str]] = {
    "two images": (flown(1, 2), BOTH, [], ""),
    "three images": (flown(1, 3), BOTH, [], ""),
    "three images, control alone": (changed(flown(1, 3), no_positions), BOTH, [], ""),
    "one strip": (flown(1, 6), BOTH, [], ""),
    "one strip, few points": (flown(1, 6, points=8, seed=2), ("graph",), [], ""),
    "two strips": (flown(2, 4), BOTH, [], ""),
    "two strips with few points in common": (flown(2, 4, apart_m=640.0), ("graph",), [], "2 components"),
    "two strips, forwards": (flown(2, 4, tilt_deg=40.0), ("graph",), [], ""),
    "two blocks": (two_apart(strips=2, per_strip=3), BOTH, [], ""),
    "two blocks, one without datum": (changed(two_apart(strips=2, per_strip=3), without_datum), BOTH, SECOND, "B101"),
    "an image without points": (changed(flown(2, 4), points_left("203", 0)), BOTH, ["203"], "203"),
    "an image with two points": (changed(flown(2, 4), points_left("203", 2)), BOTH, ["203"], "203"),
    "an image with three points": (changed(flown(2, 4), no_positions, points_left("204", 3)), BOTH, ["204"], "204"),
    "an image with two points, no position": (
        changed(flown(2, 4), no_positions, points_left("203", 2)),
        ("graph",),
        ["203"],
        "203",
    ),
    "a shuffled image at the end": (changed(flown(2, 4), no_positions, shuffled("204")), BOTH, ["204"], "204"),
    "a shuffled image in the middle": (changed(flown(3, 4), shuffled("202")), BOTH, ["202"], "202"),
    "a point at infinity": (changed(flown(2, 4), star), BOTH, [], "star"),
    "a speck of dust": (changed(flown(2, 4), dust), BOTH, [], "dust"),
    "a strip on its observed orientations": (changed(flown(3, 4), thin_strip), ("graph",), [], ""),
    "a camera without images": (changed(flown(2, 4), unused_camera), BOTH, [], "no image of camera b"),
    "control that nothing shows": (changed(flown(2, 4), unseen_control), BOTH, [], "far: seen in no image"),
}
"""Block, chains, images that are left out, what a warning has to name."""


@pytest.mark.slow(after=2)
@pytest.mark.parametrize(("name", "chain"), [(name, chain) for name, row in BLOCKS.items() for chain in row[1]])
def test_a_legal_block_ends_well(tmp_path: Path, name: str, chain: str) -> None:
    small, _, lost, named = BLOCKS[name]
    done = adjusted_by(chain, small.write(tmp_path / "block"))
    images = done.bundle.images
    assert images.id[~images.oriented].tolist() == lost
    assert any(named in line for line in done.warnings) or not named
    assert off_m(small, done.bundle) < 0.35
    assert 0.7 < done.bundle.sigma0 < 1.3
    wrong = done.bundle.suspects
    blamed = wrong.image[np.isin(wrong.verdict, ["rejected", "undecidable"]) & ~np.isin(wrong.point, ["star", "dust"])]
    assert set(blamed.tolist()) <= set(lost)


@pytest.mark.parametrize("chain", BOTH)
@pytest.mark.parametrize(
    ("control", "named"),
    [
        ({}, "holds no control point|scale, rotation about X, .* of the whole block"),
        ({"C1": "XYZ"}, "1 known in X, Y and Z"),
        ({"C1": "XYZ", "C4": "XYZ"}, "line through point C1 and point C4"),
        ({"C1": "Z", "C2": "Z", "C3": "Z"}, "3 in height only"),
    ],
)
def test_an_open_datum_ends_the_run_and_is_named(
    tmp_path: Path, chain: str, control: dict[str, str], named: str
) -> None:
    small = changed(flown(2, 4), no_positions)
    small.control = control
    with pytest.raises(AatriError) as error:
        adjusted_by(chain, small.write(tmp_path / "block"))
    assert re.search(named, f"{error.value.what} {error.value.remedy}")
