"""Legal work that readers once refused: scanned film in pixels, marks without sigmas, DBAT 3 cameras, small blocks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import TRUTH, Block
from aatri.checks.as_read.screening import screened
from aatri.errors import InputError
from aatri.formats.tables.writer import write_block
from aatri.stages.interior_orientation.affine import affine
from aatri.tables.digest import content_digest
from tests.formats.tables.block_folder import FILES, write_folder
from tests.reading import read_block, read_dbat
from tests.stages.film_blocks import Told, flown

PIXEL_MM = 0.021


def _scanned(block: Block) -> Block:
    """The same film, scanned: pixels from the corner of a scan of 280 mm, rows downwards."""

    def pixels(xy: np.ndarray) -> np.ndarray:
        return np.stack([xy[:, 0] + 140.0, 140.0 - xy[:, 1]], axis=1) / PIXEL_MM

    cameras = replace(
        block.cameras,
        image_coordinates=["pixel"],
        pixel_size_mm=[[PIXEL_MM] * 2],
        pixel_origin=["top-left-corner"],
        pixel_y=["down"],
    )
    return replace(
        block,
        cameras=cameras,
        image_points=replace(block.image_points, xy=pixels(block.image_points.xy)),
        fiducial_points=replace(block.fiducial_points, xy=pixels(block.fiducial_points.xy)),
    )


def test_scanned_film_measured_in_pixels_gives_the_photo_coordinates_of_the_comparator(tmp_path: Path) -> None:
    block = flown()
    write_block(_scanned(block), tmp_path / "scan")
    scanned = read_block(tmp_path / "scan")
    assert scanned.image_points.active.all()
    expected, found = affine(block), affine(scanned)
    np.testing.assert_allclose(found.measurements.xy_mm, expected.measurements.xy_mm, atol=2e-9)


def test_an_image_point_beyond_the_format_of_scanned_film_is_set_aside_by_interior_orientation() -> None:
    block = _scanned(flown())
    xy = block.image_points.xy.copy()
    xy[5] = [2.0, 2.0]  # the corner of the scan, 25 mm outside the film
    told = Told()
    found = affine(screened(replace(block, image_points=replace(block.image_points, xy=xy))), context=told)
    assert not found.measurements.active[5]
    assert any("outside the format" in line for line in told.warnings)


def _export(shared_data: Path, folder: Path, sigma: str) -> Path:
    """A real export in which the marks have another standard deviation."""
    lines = (shared_data / "dbat/camcal/camcal-pmexport.txt").read_text().splitlines()
    marks = [k for k, line in enumerate(lines) if len(line.split()) == 6]
    assert len(marks) > 1000
    for k in marks:
        lines[k] = " ".join([*lines[k].split()[:4], sigma])
    path = folder / "zero-pmexport.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_marks_of_standard_deviation_zero_take_one_pixel_and_say_so(tmp_path: Path, shared_data: Path) -> None:
    told = Told()
    path = _export(shared_data, tmp_path, "0.0 0.0")
    control = shared_data / "dbat/camcal/camcal-fixed.txt"
    block = read_dbat(path, control, reporter=told)
    np.testing.assert_allclose(
        block.image_points.sigma_mm, np.tile(block.cameras.pixel_size_mm[0], (len(block.image_points), 1))
    )
    assert any(
        "standard deviations 0, 0: 1 px is taken" in line and "zero-pmexport.txt:" in line for line in told.warnings
    )
    told = Told()
    block = read_dbat(path, control, image_sigma_px=0.5, reporter=told)
    np.testing.assert_allclose(block.image_points.sigma_mm[0], 0.5 * block.cameras.pixel_size_mm[0])
    assert not any("standard deviations 0" in line for line in told.warnings)


def test_one_standard_deviation_of_zero_is_refused(tmp_path: Path, shared_data: Path) -> None:
    with pytest.raises(InputError, match=r"standard deviations 0, 1"):
        read_dbat(_export(shared_data, tmp_path, "0.0 1.0"), shared_data / "dbat/camcal/camcal-fixed.txt")


@pytest.mark.parametrize("calibrate", [False, True])
def test_a_block_with_a_dbat3_camera_is_written_and_read_back(
    tmp_path: Path, shared_data: Path, calibrate: bool
) -> None:
    folder = shared_data / "dbat/camcal"
    block = read_dbat(
        folder / "camcal-pmexport.txt", folder / "camcal-fixed.txt", camera_model="dbat3", calibrate=calibrate
    )
    write_block(block, tmp_path / "copy")
    again = read_block(tmp_path / "copy")
    assert again.cameras.distortion.tolist() == ["dbat3"]
    assert "as" in again.camera_parameters.name.tolist()
    assert content_digest(again, without=TRUTH) == content_digest(block, without=TRUTH)


def test_a_small_block_may_lose_an_image(tmp_path: Path) -> None:
    block = read_block(write_folder(tmp_path / "block", {"images.csv": FILES["images.csv"] + "z9,uav,,,,,\n"}))
    assert block.rejects.id[block.rejects.kind == "image"].tolist() == ["z9"]


def test_control_with_x_and_y_swapped_is_refused_on_reading_with_its_line(tmp_path: Path) -> None:
    block = flown()
    ground = block.ground_points
    assert ground.role.any()
    write_block(block, tmp_path / "good")
    for name in ("block.yaml", "images.csv", "image_points.csv", "fiducials.csv"):
        (tmp_path / "bad").mkdir(exist_ok=True)
        (tmp_path / "bad" / name).write_text((tmp_path / "good" / name).read_text())
    rows = (tmp_path / "good/ground_points.csv").read_text().splitlines()
    shifted = [rows[0]]
    for row in rows[1:]:
        point, x, y, *rest = row.split(",")
        shifted.append(",".join([point, repr(float(x) + 446e3), repr(float(y) + 4505e3), *rest]))
    (tmp_path / "bad/ground_points.csv").write_text("\n".join(shifted) + "\n")
    read_block(tmp_path / "bad")
    control = next(k for k, row in enumerate(shifted) if k and "check" not in row)
    point, x, y, *rest = shifted[control].split(",")
    shifted[control] = ",".join([point, y, x, *rest])
    (tmp_path / "bad/ground_points.csv").write_text("\n".join(shifted) + "\n")
    with pytest.raises(
        InputError, match=rf"ground_points.csv:{control + 1}: {point} lies 5,7\d\d km from the block; with X and Y"
    ):
        read_block(tmp_path / "bad")
