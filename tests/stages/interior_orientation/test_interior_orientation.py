"""The stages of the role interior_orientation."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.errors import AatriError, GeometryError, InputError
from aatri.stages.block.wucaps import WucapsOptions, wucaps
from aatri.stages.interior_orientation.affine import FiducialOptions, affine
from aatri.stages.interior_orientation.bilinear import bilinear
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.interior_orientation.projective import projective
from aatri.stages.interior_orientation.similarity import similarity
from tests.stages.film_blocks import Told, flown, true_photo_mm, with_marks, without_marks


@pytest.fixture(scope="module")
def block() -> Block:
    return flown()


@pytest.fixture(scope="module")
def many() -> Block:
    """Enough images that one of them is less than 5 %."""
    return flown(flight={"strips": 3, "images_per_strip": 8}, noise=True)


def test_film_comes_back_to_the_photo_system(block: Block) -> None:
    found = affine(block)
    assert found.interior.model.tolist() == ["affine"] * 10
    assert found.interior.redundancy.tolist() == [2] * 10
    assert np.abs(found.fiducial_residuals.residual_mm).max() < 1e-10
    assert found.corrections.name.tolist() == ["film_deformation", "principal_point"]
    assert found.corrections.largest_mm[1] == pytest.approx(np.hypot(0.011, 0.002))
    # scales of at most 3e-4 and a shear of 1e-4 move a corner by less than 0.06 mm
    assert 0.005 < found.corrections.largest_mm[0] < 0.06
    assert found.measurements.active.all()


def test_noise_gives_sigma0_near_one(many: Block) -> None:
    # 24 images, redundancy 48: sigma0 within 1 +- 4 / sqrt(2 * 48)
    assert affine(many).metrics()["sigma0"] == pytest.approx(1.0, abs=0.41)


def test_a_turned_pixel_scan_gives_the_same_photo_coordinates(block: Block) -> None:
    from_comparator = affine(block)
    pixel = np.array([[0.0, 1 / 0.021], [1 / 0.021, 0.0]])  # a quarter turn, y down, pixels of 21 um
    cameras = replace(block.cameras, image_coordinates=["pixel"], pixel_size_mm=[[0.021, 0.021]],
                      pixel_origin=["top-left-corner"], pixel_y=["down"])  # fmt: skip
    scanned = replace(
        block,
        cameras=cameras,
        fiducial_points=replace(block.fiducial_points, xy=block.fiducial_points.xy @ pixel + 300.0),
        image_points=replace(block.image_points, xy=block.image_points.xy @ pixel + 300.0),
    )
    found = affine(scanned)
    assert np.abs(found.measurements.xy_mm - from_comparator.measurements.xy_mm).max() < 1e-10
    assert found.corrections.largest_mm == pytest.approx(from_comparator.corrections.largest_mm, abs=1e-9)


def test_mirrored_marks_are_an_error_that_names_the_direction_of_y(block: Block) -> None:
    with pytest.raises(InputError, match="mirror") as caught:
        affine(with_marks(block, 3, lambda xy: xy * [1, -1]))
    assert block.images.id[3] in caught.value.what
    assert "y: down" in caught.value.remedy


def test_exchanged_numbers_are_an_error_with_the_right_numbering(block: Block) -> None:
    with pytest.raises(InputError, match="exchanged") as caught:
        affine(with_marks(block, 0, lambda xy: xy[[1, 0, 2, 3]]))
    assert caught.value.remedy == "1 is 2, 2 is 1"


def test_a_wrong_scale_is_an_error_with_the_unit_meant(block: Block) -> None:
    marks = block.fiducial_points
    with pytest.raises(AatriError, match="micrometres taken for millimetres"):
        affine(replace(block, fiducial_points=replace(marks, xy=marks.xy * 1000.0)))


def test_an_image_with_two_marks_is_set_aside_and_told(many: Block) -> None:
    told = Told()
    marks = many.fiducial_points
    first = np.flatnonzero(marks.image == 5)[:2]
    found = affine(without_marks(many, np.isin(np.arange(len(marks)), first)), context=told)
    inactive = ~found.measurements.active
    assert set(found.measurements.image[inactive].tolist()) == {5}
    assert np.isnan(found.measurements.xy_mm[inactive]).all()
    assert 5 not in found.interior.image
    assert found.suspects.image.tolist() == [many.images.id[5]]
    assert found.suspects.verdict.tolist() == ["rejected"]
    assert "2 fiducial marks" in told.warnings[0]


def test_three_marks_are_used_with_a_warning_and_without_residuals(block: Block) -> None:
    told = Told()
    one = np.flatnonzero(block.fiducial_points.image == 2)[:1]
    found = affine(without_marks(block, np.isin(np.arange(len(block.fiducial_points)), one)), context=told)
    assert np.isnan(found.interior.sigma0[2])
    assert 2 not in found.fiducial_residuals.image
    assert any("only three fiducial marks" in text for text in told.warnings)
    assert found.measurements.active.all()


def test_a_blunder_among_four_marks_flags_the_image(block: Block) -> None:
    told = Told()
    found = affine(with_marks(block, 6, lambda xy: xy + 0.05 * (np.arange(4) == 0)[:, None]), context=told)
    assert found.suspects.image.tolist() == [block.images.id[6]]
    assert found.suspects.verdict.tolist() == ["kept"]
    assert any(
        f"sigma0 of single images is too large, a mark may be wrong: {block.images.id[6]} (12.5)" in text
        for text in told.warnings
    )


def test_an_image_beyond_max_sigma0_is_not_used(block: Block, many: Block) -> None:
    def broken(block: Block, *images: int) -> Block:
        for image in images:
            block = with_marks(block, image, lambda xy: xy + 0.1 * (np.arange(4) == 0)[:, None])
        return block

    told = Told()
    found = affine(broken(many, 6), context=told)
    assert 6 not in found.interior.image
    assert any(re.search(f"{many.images.id[6]} .sigma0 2.\\.., beyond max_sigma0 = 20", text) for text in told.warnings)
    with pytest.raises(GeometryError, match=r"6 of 10 film images .* beyond max_sigma0"):
        affine(broken(block, *range(6)))
    assert 6 in affine(broken(block, 6), options=FiducialOptions(max_sigma0=30.0)).interior.image


def test_sigma0_of_all_images_is_told_with_its_interval() -> None:
    """Noise of the standard deviation given: within the interval; standard deviations half as large: a warning."""
    noisy = flown(flight={"strips": 4, "images_per_strip": 10, "cross_strips": 0}, noise=True)
    told = Told()
    affine(noisy, context=told)
    assert [text for text in told.lines if text.startswith("sigma0 of 40 film images")]
    assert not [text for text in told.warnings if "sigma0" in text]
    marks = noisy.fiducial_points
    affine(replace(noisy, fiducial_points=replace(marks, sigma_mm=marks.sigma_mm / 3)), context=told)
    assert [text for text in told.warnings if "standard deviations that are too small" in text]


def test_a_blunder_among_eight_marks_is_rejected() -> None:
    block = flown(camera={"fiducials": 8}, noise=True)
    row = int(np.flatnonzero(block.fiducial_points.image == 1)[6])
    broken = with_marks(block, 1, lambda xy: xy + 0.08 * (np.arange(8) == 6)[:, None])
    found = affine(broken)
    assert found.suspects.row.tolist() == [row]
    assert not found.fiducial_residuals.active[found.fiducial_residuals.row == row][0]
    assert found.suspects.size[0] == pytest.approx(0.08 * np.sqrt(2), abs=0.02)
    # 2 um, and a little more for the transformation, at a mark on the edge
    assert 0.002 < found.suspects.sigma[0] < 0.003


def test_a_point_outside_the_format_is_not_used_and_many_are_an_error(block: Block) -> None:
    points = block.image_points
    far = points.xy.copy()
    far[4] += 300.0
    told = Told()
    found = affine(replace(block, image_points=replace(points, xy=far)), context=told)
    assert np.flatnonzero(~found.measurements.active).tolist() == [4]
    assert found.suspects.kind.tolist() == ["image_point"]
    assert found.suspects.row.tolist() == [4]
    with pytest.raises(InputError, match="outside the format"):
        affine(replace(block, image_points=replace(points, xy=points.xy + 300.0)))


def test_a_principal_point_far_from_the_centre_is_told(block: Block) -> None:
    told = Told()
    affine(replace(block, cameras=replace(block.cameras, principal_point_mm=[[115.0, -115.0]])), context=told)
    assert any("principal point" in text for text in told.warnings)


def test_marks_without_standard_deviation_are_refused(block: Block) -> None:
    marks = block.fiducial_points
    with pytest.raises(InputError, match="not positive"):
        affine(replace(block, fiducial_points=replace(marks, sigma_mm=np.zeros((len(marks), 2)))))


def test_digital_images_lose_their_principal_point_only() -> None:
    block = flown(
        camera={"kind": "digital", "format": (11500, 11500), "pixel_size_mm": 0.02, "principal_point_mm": (0.03, -0.05)}
    )
    found = calibrated(block)
    wanted = (block.image_points.xy - 5750.0) * [0.02, -0.02] - [0.03, -0.05]
    assert found.measurements.xy_mm == pytest.approx(wanted, abs=1e-12)
    assert not found.interior.covariance.any()
    assert found.corrections.name.tolist() == ["principal_point"]
    by_affine = affine(block)
    assert np.array_equal(by_affine.measurements.xy_mm, found.measurements.xy_mm)
    assert by_affine.corrections.name.tolist() == ["principal_point"]


def test_comparator_coordinates_need_fiducial_marks(block: Block) -> None:
    with pytest.raises(InputError, match="no calibrated relation") as caught:
        calibrated(block)
    assert "affine" in caught.value.remedy


def test_a_mixed_block_goes_both_ways(block: Block) -> None:
    cameras = block.cameras
    two = replace(cameras, **{name: np.concatenate([getattr(cameras, name)] * 2) for name in cameras.__annotations__
                              if name not in ("id", "image_coordinates")},
                  id=["a", "b"], image_coordinates=["comparator", "photo"])  # fmt: skip
    camera = np.repeat([0, 1], 5)
    photo = affine(block).measurements.xy_mm + cameras.principal_point_mm[0]
    of_second = camera[block.image_points.image] == 1
    mixed = replace(
        block,
        cameras=two,
        images=replace(block.images, camera=camera),
        fiducials=replace(block.fiducials, camera=np.zeros(4, int)),
        fiducial_points=block.fiducial_points.take(camera[block.fiducial_points.image] == 0),
        image_points=replace(block.image_points, xy=np.where(of_second[:, None], photo, block.image_points.xy)),
        camera_parameters=block.camera_parameters,
    )
    found = affine(mixed)
    assert found.interior.model.tolist() == ["affine"] * 5 + ["calibrated"] * 5
    assert np.abs(found.measurements.xy_mm - affine(block).measurements.xy_mm).max() < 1e-12


def test_real_photo_coordinates_of_wucaps_lose_the_principal_point(shared_data: Path) -> None:
    path = shared_data / "rc30_2x3/Data/bundle_ajustment"
    found = affine(wucaps(options=WucapsOptions(path=path)))
    # PRECAI.dat: x0 = 0.011, y0 = 0.002
    assert found.corrections.largest_mm.tolist() == pytest.approx([np.hypot(0.011, 0.002)])


@pytest.mark.parametrize("variant", [affine, bilinear, projective])
@pytest.mark.parametrize("marks", [4, 8])
def test_every_variant_gives_true_photo_coordinates_of_affinely_deformed_film(variant: Any, marks: int) -> None:
    block = flown(camera={"fiducials": marks}, refraction="none")
    found = variant(block)
    assert found.measurements.xy_mm == pytest.approx(true_photo_mm(block), abs=1e-9)
    # the film as simulated: 2e-4 ... 3e-4 in scale, and a shear
    assert 1e-5 < np.abs(found.interior.film_scale - 1).max() < 1e-3
    reference = affine(block).interior
    assert found.interior.film_scale == pytest.approx(reference.film_scale, abs=1e-9)
    assert found.interior.film_shear_rad == pytest.approx(reference.film_shear_rad, abs=1e-9)


def test_a_similarity_gives_true_photo_coordinates_of_film_without_deformation() -> None:
    block = flown(camera={}, film={"deformation": False}, refraction="none")
    found = similarity(block)
    assert found.measurements.xy_mm == pytest.approx(true_photo_mm(block), abs=1e-9)
    assert found.interior.redundancy.tolist() == [4] * 10
    assert found.corrections.largest_mm[0] < 1e-9


def test_a_similarity_leaves_the_deformation_and_shows_it_in_sigma0() -> None:
    block = flown()
    found = similarity(block)
    assert np.abs(found.measurements.xy_mm - true_photo_mm(block)).max() > 0.005
    assert np.nanmean(found.interior.sigma0) > 3


@pytest.mark.parametrize("variant", [similarity, affine, bilinear, projective])
def test_exchanged_and_mirrored_marks_are_told_by_every_variant(block: Block, variant: Any) -> None:
    """A projective transformation fits any four marks; the numbering is checked apart from it."""
    with pytest.raises(InputError, match="exchanged") as caught:
        variant(with_marks(block, 0, lambda xy: xy[[1, 0, 2, 3]]))
    assert caught.value.remedy == "1 is 2, 2 is 1"
    with pytest.raises(InputError, match="mirror"):
        variant(with_marks(block, 3, lambda xy: xy * [1, -1]))


def test_marks_both_mirrored_and_exchanged_are_told_with_the_numbers_that_fit() -> None:
    """Of marks that do not lie symmetrically: of others an exchange alone would explain it."""
    block = flown(camera={"fiducials": 8}, film={"deformation": False, "rotation_deg": 0.0})
    fiducials, marks = block.fiducials, block.fiducial_points
    aside = np.where(fiducials.id == "5", 30.0, 0.0)[:, None] * [0.0, 1.0]
    block = replace(block, fiducials=replace(fiducials, xy_mm=fiducials.xy_mm + aside),
                    fiducial_points=replace(marks, xy=marks.xy + aside[marks.fiducial]))  # fmt: skip
    assert affine(block).interior.sigma0.max() < 1e-6
    with pytest.raises(InputError, match="mirror image, and with their numbers exchanged") as caught:
        affine(with_marks(block, 2, lambda xy: (xy * [-1, 1])[[0, 1, 3, 2, 4, 5, 6, 7]]))
    assert "y: down" in caught.value.remedy


def test_three_marks_are_too_few_for_eight_parameters(block: Block) -> None:
    first = np.unique(block.fiducial_points.image, return_index=True)[1]
    with pytest.raises(GeometryError, match="3 fiducial marks") as caught:
        projective(without_marks(block, np.isin(np.arange(len(block.fiducial_points)), first)))
    assert "fewer parameters" in str(caught.value.remedy)


def test_one_wrong_mark_among_eight_is_rejected_by_every_variant() -> None:
    block = flown(camera={"fiducials": 8}, noise=True, film={"deformation": False})
    row = int(np.flatnonzero(block.fiducial_points.image == 1)[3])
    broken = with_marks(block, 1, lambda xy: xy + 0.08 * (np.arange(8) == 3)[:, None])
    for variant in (similarity, affine, bilinear, projective):
        assert row in variant(broken).suspects.row.tolist()
