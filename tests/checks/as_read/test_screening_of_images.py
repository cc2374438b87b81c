"""Rule 3 of screening: images with too few points, and what goes with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.progress import Silent
from tests.checks.as_read.test_screening import Written, rejects
from tests.reading import read_block
from tests.small_blocks import Small, Told, flown, measure


def more_images(points: int) -> Written:
    """Twenty images of ten points, and one more that shows only so many of them."""
    of = Written(images=[f"i{k}" for k in range(20)])
    of.images.append("few")
    of.points += [f"few,p{k},{k},{k}" for k in range(points)]
    return of


@pytest.mark.parametrize(("points", "stays"), [(3, True), (2, False)])
def test_an_image_needs_three_points(tmp_path: Path, points: int, stays: bool) -> None:
    block = more_images(points).read(tmp_path)
    assert block.images.active.tolist().count(False) == (not stays)
    expected = (
        []
        if stays
        else [
            ("image", "few", "fewer than 3 points and no observed position"),
            ("image_point", "few/p0", "its image is rejected"),
            ("image_point", "few/p1", "its image is rejected"),
        ]
    )
    assert rejects(block) == expected


def test_the_same_point_twice_is_one_point_of_an_image(tmp_path: Path) -> None:
    of = more_images(2)
    of.points.append("few,p1,1,1")
    assert ("image", "few", "fewer than 3 points and no observed position") in rejects(of.read(tmp_path))


@pytest.mark.parametrize(
    ("cells", "stays"), [("1,2,3,observed", True), ("1,2,3,approximate", False), ("1,2,,observed", False)]
)
def test_an_image_with_an_observed_position_stays(tmp_path: Path, cells: str, stays: bool) -> None:
    of = more_images(1)
    of.exterior = [f"few,{cells}", "i0,5,6,7,observed"]
    assert (("image", "few", "fewer than 3 points and no observed position") in rejects(of.read(tmp_path))) != stays


@pytest.mark.parametrize("count", [1, 5])
def test_images_with_few_points_go_and_the_others_stay(tmp_path: Path, count: int) -> None:
    of = Written(images=[f"i{k}" for k in range(20 - count)])
    of.images += [f"few{k}" for k in range(count)]
    of.points += [f"few{k},p1,1,1" for k in range(count)]
    assert of.read(tmp_path).images.active.sum() == 20 - count


def test_what_goes_takes_with_it_what_rested_on_it(tmp_path: Path) -> None:
    """Without `few` the point a is seen once; without a the image b has two points; and so on to the end."""
    of = Written(images=[f"i{k}" for k in range(60)], halves=True)
    of.images += ["few", "b"]
    of.points += ["few,a,1,1", "few,p1,2,2", "b,a,1,1", "b,p1,2,2", "b,p2,3,3"]
    block = of.read(tmp_path)
    assert rejects(block) == [
        ("image", "b", "fewer than 3 points and no observed position"),
        ("image", "few", "fewer than 3 points and no observed position"),
        ("image_point", "b/a", "seen in one image only"),
        ("image_point", "b/p1", "its image is rejected"),
        ("image_point", "b/p2", "its image is rejected"),
        ("image_point", "few/a", "its image is rejected"),
        ("image_point", "few/p1", "its image is rejected"),
    ]
    assert block.rejects.line.tolist() == [63, 62, 604, 605, 606, 602, 603]


def test_every_reject_is_said_aloud(tmp_path: Path) -> None:
    class Heard(Silent):
        def __init__(self) -> None:
            self.warned: list[str] = []

        def warn(self, message: str) -> None:
            self.warned.append(message)

    of, heard = more_images(1), Heard()
    of.points[13] = "i1,p3,500,0"
    of.read(tmp_path, heard)
    said = [line for line in heard.warned if line.startswith("rejected: ")]
    assert said == [
        "rejected: image few: fewer than 3 points and no observed position",
        "rejected: image_point few/p0: its image is rejected",
        "rejected: image_point i1/p3: outside the image format",
    ]


# Ids exchanged


def exchanged_by_screening(small: Small, folder: Path) -> list[str]:
    heard = Told()
    read_block(small.write(folder), heard)
    return [text.split("images ")[1].split(" fit")[0] for text in heard.warnings if "ids exchanged" in text]


@pytest.mark.parametrize(
    ("first", "second"),
    [("102", "103"), ("101", "102"), ("102", "104"), ("103", "205"), ("101", "203"), ("102", "105")],
)
def test_two_images_with_each_others_ids_are_named_by_the_points_of_their_neighbours(
    tmp_path: Path, first: str, second: str
) -> None:
    small = flown(2, 6, points=40, apart_m=1200.0)  # strips that share no point
    other = {first: second, second: first}
    small.rays = {(other.get(i, i), p): xy for (i, p), xy in small.rays.items()}
    assert exchanged_by_screening(small, tmp_path / "b") == [f"{first} and {second}"]


def test_images_in_order_stay_unnamed_under_clouds_and_with_few_points(tmp_path: Path) -> None:
    small = flown(3, 6, points=40, apart_m=200.0)
    assert exchanged_by_screening(small, tmp_path / "clear") == []
    cloudy = {(i, p): xy for (i, p), xy in small.rays.items() if i not in ("102", "205") or xy[0] < -20.0}
    few = {(i, p): xy for (i, p), xy in cloudy.items() if i not in ("104", "301") or p.endswith(("1", "4"))}
    small.rays = few
    assert exchanged_by_screening(small, tmp_path / "cloudy") == []


@pytest.mark.parametrize(("axis", "base_m"), [("x", 60.0), ("x", 100.0), ("y", 60.0), ("y", 100.0)])
def test_images_of_a_camera_that_swings_to_and_fro_are_in_order(tmp_path: Path, axis: str, base_m: float) -> None:
    """25 degrees to the sides, or fore and aft: the ground of every second image lies nearer than that of the next."""
    small, rng = flown(1, 8), np.random.default_rng(1)
    for k, name in enumerate(sorted(small.position_m)):
        swing = Rotation.from_euler(axis, 25.0 * (-1) ** k, degrees=True)
        small.rotation[name] = small.rotation[name] @ swing.as_matrix()
        small.position_m[name] = np.array([300.0 + base_m * k, *small.position_m[name][1:]])
    ground = rng.uniform([-200, -400, 0], [8 * base_m + 800, 1400, 30], (400, 3))
    small.xyz_m, small.control = {f"p{k}": X for k, X in enumerate(ground)}, {}
    measure(small, rng)
    assert exchanged_by_screening(small, tmp_path / "b") == []
