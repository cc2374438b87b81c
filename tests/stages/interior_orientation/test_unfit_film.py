"""Film that cannot be used is left out or an error; too few parameters, or pixels the other way, are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.errors import Errors, GeometryError, InputError
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.interior_orientation.similarity import similarity
from tests.stages.film_blocks import Told, flown, with_marks, without_marks
from tests.stages.initial_orientation.unordered import SMALL_UAV, simulated


@pytest.fixture(scope="module")
def block() -> Block:
    return flown()


def sheared(block: Block, by: float) -> Block:
    for image in range(len(block.images)):
        block = with_marks(block, image, lambda xy: xy @ np.array([[1.0, 0.0], [by, 1.0]]))
    return block


def test_a_similarity_on_film_that_shears_is_called_too_simple(block: Block) -> None:
    told, fits = Told(), Told()
    similarity(sheared(block, 2e-4), context=told)
    assert any("too simple for this film" in t and "interior_orientation/affine" in t for t in told.warnings)
    assert not any("in the same way in all" in t or "a mark may be wrong" in t for t in told.warnings)
    affine(sheared(block, 2e-4), context=fits)
    assert not any("too simple" in t for t in fits.warnings)
    with pytest.raises(GeometryError) as caught:
        similarity(sheared(block, 1e-3))
    assert "too simple for this film" in str(caught.value)


@pytest.mark.parametrize("off_mm", [0.05, 1.0])
def test_a_wrong_calibrated_mark_is_told_of_the_camera_and_not_of_the_images(off_mm: float) -> None:
    """One of four marks by 1 mm: before, affine film was said to need marks; by 0.05 mm: "a mark may be wrong"."""
    block, told = flown(noise=True), Told()
    xy_mm = block.fiducials.xy_mm + np.array([[off_mm, 0.0], *[[0.0, 0.0]] * 3])
    wrong = replace(block, fiducials=replace(block.fiducials, xy_mm=xy_mm))
    text = "in the same way in all"
    if off_mm < 1.0:
        affine(wrong, context=told)
        assert sum(text in t for t in told.warnings) == 1
        assert not any("a mark may be wrong" in t for t in told.warnings)
    else:
        with pytest.raises(GeometryError) as raised:
            affine(wrong)
        assert text in raised.value.remedy
    clean = Told()
    affine(block, context=clean)
    assert not any(text in t for t in clean.warnings)


def test_a_camera_of_wrong_calibration_hides_no_image_of_another() -> None:
    """All images of camera a by one of its calibrated marks, one image of camera b by a measured mark."""
    block, told = flown(noise=True), Told()
    cameras, fiducials = block.cameras.take(np.array([0, 0])), block.fiducials.take(np.tile(np.arange(4), 2))
    camera, of_b = (np.arange(10) >= 5).astype(np.int32), block.fiducial_points.image >= 5
    xy_mm = fiducials.xy_mm + np.array([[0.05, 0.0], *[[0.0, 0.0]] * 7])
    two = replace(
        block,
        cameras=replace(cameras, id=np.array(["a", "b"])),
        images=replace(block.images, camera=camera),
        fiducials=replace(fiducials, camera=np.repeat(np.arange(2, dtype=np.int32), 4), xy_mm=xy_mm),
        fiducial_points=replace(
            block.fiducial_points, fiducial=(block.fiducial_points.fiducial + 4 * of_b).astype(np.int32)
        ),
    )
    off_mm = np.array([[0.1, 0.0], *[[0.0, 0.0]] * 3])
    affine(with_marks(two, 7, lambda xy: xy + off_mm), context=told)
    assert sum("in the same way in all" in t for t in told.warnings) == 1
    [high] = [t for t in told.warnings if "a mark may be wrong" in t]
    assert block.images.id[7] in high
    assert not any(name in high for name in block.images.id[:5])


def test_marks_of_different_scales_are_different_errors(block: Block) -> None:
    """Image 0 in inches, the others too large by a tenth: the reader of the error of all is not sent to inches."""
    for image in range(len(block.images)):
        block = with_marks(block, image, lambda xy, by=25.4 if image == 0 else 1.1: xy / by)
    with pytest.raises(Errors) as raised:
        affine(block)
    for text in (f"image {block.images.id[0]}: the scale is 25.4", "9 of 10 film images", "the scale is 1.1 instead"):
        assert text in str(raised.value)


def test_what_is_wrong_with_the_marks_of_all_images_is_one_error(block: Block) -> None:
    with pytest.raises(InputError, match=r"of \d+ film images, .* and \d+ more: the scale is 1\.1"):
        affine(replace(block, fiducials=replace(block.fiducials, xy_mm=1.1 * block.fiducials.xy_mm)))


@pytest.mark.parametrize(("y", "origin"), [("down", "top-left-corner"), ("up", "bottom-left-corner")])
def test_y_of_pixels_that_counts_the_other_way_is_named(y: str, origin: str) -> None:
    aerial = simulated(**{**SMALL_UAV, "flight": {"strips": 1, "images_per_strip": 2}})
    cameras = replace(aerial.cameras, pixel_origin=np.array([origin]), pixel_y=np.array([y]))
    right = replace(aerial, cameras=cameras)
    assert calibrated(right).measurements.active.all()
    wrong = replace(right, cameras=replace(cameras, pixel_y=np.array(["up" if y == "down" else "down"])))
    with pytest.raises(InputError, match="outside the format") as raised:
        calibrated(wrong)
    assert f"turn y of camera {aerial.cameras.id[0]} " in raised.value.remedy


def test_points_that_count_from_the_middle_and_lie_outside_are_not_told_to_turn_y() -> None:
    """Off by one format they would lie inside after a turn from a corner; from the middle a turn moves none inside."""
    aerial = simulated(**{**SMALL_UAV, "flight": {"strips": 1, "images_per_strip": 2}})
    m, width_height = aerial.image_points, aerial.cameras.format[0]
    centred = replace(aerial.cameras, pixel_origin=np.array(["image-centre"]), pixel_y=np.array(["up"]))
    xy = (m.xy - width_height / 2) * [1.0, -1.0] + [0.0, width_height[1]]
    with pytest.raises(InputError, match="outside the format") as raised:
        calibrated(replace(aerial, cameras=centred, image_points=replace(m, xy=xy)))
    assert raised.value.remedy.startswith("check the camera's format")


@pytest.mark.parametrize("lacking", [1, 5, 6])
def test_images_without_marks_are_left_out_and_an_error_where_they_are_most(block: Block, lacking: int) -> None:
    some, told = without_marks(block, block.fiducial_points.image < lacking), Told()
    if lacking > 5:
        with pytest.raises(GeometryError, match="6 of 10 film images") as caught:
            affine(some)
        assert block.images.id[4] in caught.value.what
        return
    np.testing.assert_array_equal(affine(some, context=told).interior.image, np.arange(lacking, 10))
    assert all(any(name in text for text in told.warnings) for name in block.images.id[:lacking])
