"""Fiducial marks of made-up scans: turned, mirrored, negative, 16 bit in tiles; real marks found or said not to be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.adapters.interior.image_pixels import from_first_pixel, pixel_matrices, with_fiducials
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.pixels.drawn_marks import drawn
from aatri.pixels.mark_search import best_place
from aatri.pixels.reading import whole_image
from aatri.stages.fiducial_marks.template import TemplateOptions, template
from tests.made_scans import MARKS, PIXEL_MM, SIZE, Array, scan, scanned_block
from tests.stages.film_blocks import Told

pytest.importorskip("cv2")
tifffile = pytest.importorskip("tifffile")

OPTIONS = TemplateOptions(size_mm=2.0, stroke_mm=0.15, search_mm=6.0)


def _off_px(block: Block, places: dict[str, Array]) -> Array:
    found = block.fiducials.id[block.fiducial_points.fiducial]
    return np.asarray(block.fiducial_points.xy - 0.5 - np.array([places[name] for name in found]))


@pytest.mark.slow
def test_crosses_are_found_to_a_twentieth_of_a_pixel_at_noise_15_and_5_degrees(tmp_path: Path) -> None:
    picture, places = scan(5.0, 15.0)
    tifffile.imwrite(tmp_path / "a.tif", (picture * 4095).astype(np.uint16), tile=(256, 256))  # 12 bits in 16
    ear = Told()
    block = template(scanned_block(tmp_path / "a.tif"), options=OPTIONS, context=ear)
    assert len(block.fiducial_points) == 4
    assert ear.warnings == []
    off = _off_px(block, places)
    assert np.sqrt((off**2).mean()) < 0.05
    sigma_px = block.fiducial_points.sigma_mm / PIXEL_MM
    assert (np.abs(off) < 4 * sigma_px).all()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("quarters", "mirrored"), [(1, False), (0, True), (3, True)])
def test_turned_mirrored_and_negative_scans(tmp_path: Path, quarters: int, mirrored: bool) -> None:
    picture, places = scan(0.3, 4.0)
    scanned = np.rot90(1.0 - picture, -quarters)  # clockwise
    scanned = scanned[:, ::-1] if mirrored else scanned
    tifffile.imwrite(tmp_path / "a.tif", (np.ascontiguousarray(scanned) * 255).astype(np.uint8))
    for name, (x, y) in places.items():
        for _ in range(quarters):
            x, y = SIZE - 1 - y, x
        places[name] = np.array([SIZE - 1 - x if mirrored else x, y])
    ear = Told()
    block = template(scanned_block(tmp_path / "a.tif"), options=OPTIONS, context=ear)
    assert len(block.fiducial_points) == 4
    assert len(ear.warnings) == 1
    assert "turned by" in ear.warnings[0]
    assert ("mirrored" in ear.warnings[0]) == mirrored
    assert np.abs(_off_px(block, places)).max() < 0.05


@pytest.mark.slow
def test_a_mark_that_is_not_there_is_named(tmp_path: Path) -> None:
    picture, places = scan(0.7, 8.0, without=("3",))
    tifffile.imwrite(tmp_path / "a.tif", (picture * 255).astype(np.uint8))
    ear = Told()
    block = template(scanned_block(tmp_path / "a.tif"), options=OPTIONS, context=ear)
    assert block.fiducials.id[block.fiducial_points.fiducial].tolist() == ["1", "2", "4"]
    assert "a: fiducial marks not found: 3" in ear.warnings
    assert np.abs(_off_px(block, places)).max() < 0.05


def test_an_image_without_marks_is_refused(tmp_path: Path) -> None:
    picture, _ = scan(0.7, 8.0, without=tuple(MARKS))
    tifffile.imwrite(tmp_path / "a.tif", (picture * 255).astype(np.uint8))
    with pytest.raises(InputError, match="no fiducial mark found"):
        template(scanned_block(tmp_path / "a.tif"), options=OPTIONS)


@pytest.mark.slow
def test_real_crosses_are_found_and_other_marks_are_not_taken_for_crosses(shared_data: Path) -> None:
    """Sixteen marks cut from scans: four crosses with arms of 112 px, and notches, dots and arrows."""
    found = {}
    for path in sorted((shared_data / "images" / "fiducials").glob("*/*/*")):
        best = best_place(whole_image(str(path)).astype(float), drawn("cross", 112, 4), negative=None)
        good = abs(best.correlation) > 0.8 and best.second < 0.75 and np.isfinite(best.xy_px).all()
        found["/".join(path.parts[-3:])] = best.xy_px if good else None
    assert len(found) == 16
    assert {name for name, xy in found.items() if xy is not None} == {f"nagap/arc/{side}.jpg" for side in "BLRT"}


def test_pixels_of_film_lie_where_its_marks_put_them(tmp_path: Path) -> None:
    block = scanned_block(tmp_path / "a.tif")
    with pytest.raises(InputError, match="none of 1 film images has three measured fiducial marks that fit"):
        pixel_matrices(block)
    from_below = replace(block, cameras=replace(block.cameras, pixel_origin=np.array(["bottom-left-corner"])))
    with pytest.raises(InputError, match=r"camera c: .*counted from bottom-left-corner"):
        from_first_pixel(from_below)
    A, t = np.array([[0.0121, 0.0002], [-0.0003, -0.0119]]), np.array([-25.0, 26.0])
    marks = block.fiducials.xy_mm
    rows = np.arange(len(marks), dtype=np.int32)
    px = np.linalg.solve(A, (marks - t).T).T  # of the file, from the centre of its first pixel
    block = with_fiducials(block, 0 * rows, rows, px + 0.5, np.full(marks.shape, 0.001))
    assert block.cameras.pixel_origin[0] == "top-left-corner"
    np.testing.assert_allclose(pixel_matrices(block)[0, :, :2], A, atol=1e-12)
    np.testing.assert_allclose(pixel_matrices(block)[0, :, 2], t - block.cameras.principal_point_mm[0], atol=1e-9)
