"""Images measured from the wrong side: x of all their points has the opposite sign."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.checks.as_read.mirrored_images import mirrored_cameras
from aatri.errors import InputError
from tests.reading import read_block
from tests.small_blocks import C_MM, Small, flown, measure


def set_aside(small: Small, folder: Path) -> list[str]:
    block = read_block(small.write(folder))
    return [
        str(name)
        for name, reason in zip(block.rejects.id, block.rejects.reason)
        if "only as a mirror image" in reason and name in block.images.id[~block.images.active]
    ]


def mirror(small: Small, *images: str) -> None:
    small.rays = {(i, p): xy * [-1.0, 1.0] if i in images else xy for (i, p), xy in small.rays.items()}


@pytest.mark.parametrize("images", [("103",), ("101",), ("206",), ("102", "103"), ("102", "205"), ("101", "106")])
def test_images_that_fit_their_neighbours_mirrored_are_set_aside(tmp_path: Path, images: tuple[str, ...]) -> None:
    small = flown(2, 6)
    mirror(small, *images)
    assert set_aside(small, tmp_path / "b") == list(images)


def test_where_as_many_are_mirrored_as_not_nothing_tells_which(tmp_path: Path) -> None:
    small = flown(1, 4)
    mirror(small, "102", "103")
    assert set_aside(small, tmp_path / "b") == []


def test_what_all_images_have_in_common_mirrors_none(tmp_path: Path) -> None:
    small = flown(2, 5)
    mirror(small, *small.strip)
    assert set_aside(small, tmp_path / "b") == []


def test_a_scan_whose_y_points_down_is_not_mirrored_beside_photo_coordinates(tmp_path: Path) -> None:
    small = flown(1, 6)
    marks = {"1": (70.0, -70.0), "2": (-70.0, -70.0), "3": (-70.0, 70.0), "4": (70.0, 70.0)}
    scanned, pixel_mm = ("103", "104"), 0.02
    small.more_cameras = {
        "film": {
            "kind": "film",
            "image_coordinates": "pixel",
            "principal_distance": 100.0,
            "principal_point": [0.0, 0.0],
            "format": [12000, 12000],
            "pixel": {"size": pixel_mm, "origin": "top-left-corner", "y": "down"},
            "fiducials": {name: list(xy) for name, xy in marks.items()},
        }
    }

    def in_scan(xy: np.ndarray) -> np.ndarray:
        return (np.asarray(xy) * [1.0, -1.0] + 120.0) / pixel_mm

    small.rays = {(i, p): in_scan(xy) if i in scanned else xy for (i, p), xy in small.rays.items()}
    folder = small.write(tmp_path / "b")
    images = (folder / "images.csv").read_text()
    for name in scanned:
        images = images.replace(f"{name},a,", f"{name},film,")
    (folder / "images.csv").write_text(images)
    rows = [f"{i},{name},{x!r},{y!r}" for i in scanned for name, xy in marks.items() for x, y in [in_scan(xy).tolist()]]
    (folder / "fiducials.csv").write_text("\n".join(["image,fiducial,x,y", *rows, ""]))
    block = read_block(folder)
    assert block.images.active.all()


def test_points_of_other_numbers_are_no_mirror_image(tmp_path: Path) -> None:
    for seed in range(12):
        small, rng = flown(1, 5, seed=seed), np.random.default_rng(seed)
        seen = small.seen_by("103")
        moved = dict(zip(seen, rng.permutation([small.rays["103", p] for p in seen])))
        small.rays |= {("103", p): xy for p, xy in moved.items()}
        assert set_aside(small, tmp_path / str(seed)) == []


@pytest.mark.parametrize("relief_m", [60.0, 200.0])
@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 35.0])
def test_heights_and_cameras_that_swing_mirror_none(tmp_path: Path, relief_m: float, angle_deg: float) -> None:
    """To the sides by turns, over ground that rises to four tenths of the flying height."""
    for axis in "xy":
        small, rng = flown(1, 8, relief_m=relief_m, points=25), np.random.default_rng(1)
        for k, name in enumerate(sorted(small.position_m)):
            swing = Rotation.from_euler(axis, angle_deg * (-1) ** k, degrees=True)
            small.rotation[name] = small.rotation[name] @ swing.as_matrix()
        measure(small, rng)
        assert set_aside(small, tmp_path / axis) == []


def test_points_along_a_line_mirror_none(tmp_path: Path) -> None:
    """A dike of 10 m along the strip: both fit."""
    for seed in range(6):
        small, rng = flown(1, 6), np.random.default_rng(seed)
        dike = np.column_stack([rng.uniform(-100, 1600, 60), rng.uniform(-5, 5, 60), rng.uniform(0, 10, 60)])
        small.xyz_m, small.control = {f"p{k}": X for k, X in enumerate(dike)}, {}
        measure(small, rng)
        assert set_aside(small, tmp_path / str(seed)) == []


def with_two_cameras(sign: list[float], control: int) -> tuple[Small, list[str]]:
    """The second and fourth of four strips are photographed by another camera, whose axes have these signs."""
    small = flown(4, 4, points=20)
    others = [name for name, (strip, _) in small.strip.items() if strip in ("S2", "S4")]
    small.more_cameras = {
        "b": {
            "kind": "digital",
            "image_coordinates": "photo",
            "principal_distance": C_MM,
            "principal_point": [0.0, 0.0],
            "format": [30000, 30000],
            "pixel": {"size": 0.005},
        }
    }
    small.camera_of = dict.fromkeys(others, "b")
    small.control = dict.fromkeys([p for p in small.xyz_m if sum(q == p for _, q in small.rays) > 3][:control], "XYZ")
    small.rays = {(i, p): xy * (sign if i in others else 1.0) for (i, p), xy in small.rays.items()}
    return small, others


@pytest.mark.parametrize("sign", [[-1.0, 1.0], [1.0, -1.0]])
def test_a_camera_that_is_mirrored_is_named_and_its_images_are_set_aside(tmp_path: Path, sign: list[float]) -> None:
    small, others = with_two_cameras(sign, 25)
    block = read_block(small.write(tmp_path / "b"))
    assert block.images.id[~block.images.active].tolist() == others
    assert all("camera b: its images" in reason for reason in block.rejects.reason[np.isin(block.rejects.id, others)])


def test_where_control_does_not_tell_which_camera_is_mirrored_both_are_named(tmp_path: Path) -> None:
    small, _ = with_two_cameras([-1.0, 1.0], 3)
    with pytest.raises(InputError, match="cameras a, b see the same points from opposite sides"):
        read_block(small.write(tmp_path / "b"))


@pytest.mark.slow
def test_a_camera_for_every_image_takes_memory_by_the_overlaps_and_not_by_the_square(tmp_path: Path) -> None:
    """20,000 images in a row, each with a camera of its own and five points in common with the next."""
    small, _ = with_two_cameras([1.0, 1.0], 3)
    block, n = read_block(small.write(tmp_path / "b")), 20_000
    row, place_mm = np.arange(n, dtype=np.int32), np.random.default_rng(1).uniform(-70.0, 70.0, (5 * (n + 1), 2))
    image, point = np.repeat(row, 10), (5 * row[:, None] + np.arange(10)).ravel()
    xy_mm = place_mm[point] * np.where((image % 3 == 1)[:, None], [-1.0, 1.0], 1.0)
    of_none = np.zeros(n, dtype=int)
    large: Any = SimpleNamespace(
        cameras=block.cameras.take(of_none),
        images=replace(block.images.take(of_none), camera=row),
        points=range(len(place_mm)),
        image_points=replace(block.image_points.take(of_none[image]), image=image, point=point.astype(np.int32)),
        ground_points=block.ground_points.take(of_none[:0]),
    )
    tracemalloc.start()
    right, either = mirrored_cameras(large, xy_mm, np.ones(len(image), dtype=bool))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 150e6, f"{peak / 1e6:.0f} MB"
    assert not len(right)
    np.testing.assert_array_equal(either, row)


def test_two_right_cameras_are_not_mirrored(tmp_path: Path) -> None:
    small, _ = with_two_cameras([1.0, 1.0], 25)
    assert read_block(small.write(tmp_path / "b")).images.active.all()
