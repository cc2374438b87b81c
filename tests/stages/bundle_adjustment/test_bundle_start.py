"""Where a bundle starts: orientations of the block, observed positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block, Exterior
from aatri.errors import GeometryError
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.bundle_adjustment.test_bundle_input import CORNERS, OF, assert_is_the_block, exterior_rows, rows_of
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told
from tests.stages.hand_block import (
    Heard,
    angles_deg,
    ground_rows,
    read,
    start,
)

OFF = SystematicOptions(refraction=False, earth_curvature=False)
CAMERA = {"kind": "digital", "format": (6000.0, 6000.0), "pixel_size_mm": 0.01, "principal_distance_mm": 60.0}


def _without_exterior(control: int) -> Block:
    block = simulated(1, camera=CAMERA, flight={"strips": 2, "images_per_strip": 3}, known={"full": control})
    return replace(block, exterior=Exterior.empty())


def test_a_block_of_control_alone_starts_by_resection_of_every_image() -> None:
    block = _without_exterior(30)
    solution = bundle(block, systematic(block, calibrated(block)))
    assert solution.images.oriented.all()
    truth = block.true_images
    assert truth is not None
    error = solution.images.position_m[truth.image] - truth.position_m
    sigma = np.sqrt(np.einsum("nii->ni", solution.images.covariance))[:, :3]
    assert (np.abs(error) < 5 * sigma + 0.01).all()
    assert 0.8 < solution.sigma0 < 1.2


def test_an_image_with_the_points_of_another_order_is_left_out_and_its_points_are_said_to_fit_no_orientation() -> None:
    block = _without_exterior(30)
    points = block.image_points
    of_second = np.flatnonzero(points.image == 1)
    xy = points.xy.copy()
    xy[of_second] = np.random.default_rng(2).permutation(xy[of_second])
    block, told = replace(block, image_points=replace(points, xy=xy)), Told()
    solution = bundle(block, systematic(block, calibrated(block)), context=told)
    assert solution.images.id[~solution.images.oriented].tolist() == [block.images.id[1]]
    (text,) = [text for text in told.warnings if "left out" in text and "images)" in text]
    assert "their points fit no orientation (1 of 6 images)" in text
    assert "numbers of their points" in text


def test_of_an_image_that_shows_points_along_a_line_alone_it_is_not_said_that_they_fit_no_orientation() -> None:
    block = _without_exterior(30)
    points = block.image_points
    of_second = np.flatnonzero(points.image == 1)
    xy, active = points.xy.copy(), points.active.copy()
    along = of_second[np.argsort(np.abs(xy[of_second, 0] - np.median(xy[of_second, 0])))][:8]
    active[of_second], active[along] = False, True
    xy[along, 0] = np.median(xy[along, 0]) + np.arange(8)
    xy[along] = np.random.default_rng(2).permutation(xy[along])
    block, context = replace(block, image_points=replace(points, xy=xy, active=active)), Told()
    solution = bundle(block, systematic(block, calibrated(block)), context=context)
    assert solution.images.id[~solution.images.oriented].tolist() == [block.images.id[1]]
    (text,) = [text for text in context.warnings if "left out" in text and "images)" in text]
    assert "no start or too few points (1 of 6 images)" in text


def test_with_too_little_control_in_every_image_what_is_missing_is_said() -> None:
    block = _without_exterior(3)
    with pytest.raises(GeometryError, match="none sees four control points"):
        bundle(block, systematic(block, calibrated(block), options=OFF))


def test_images_with_a_position_only_are_turned_by_resection(tmp_path: Path) -> None:
    angles = angles_deg(OF, "omega-phi-kappa")
    rows = exterior_rows(OF, angles, tail=",0.1,0.1,0.1", head=",sX,sY,sZ").splitlines()
    for k in (2, 5):
        cells = rows[1 + k].split(",")
        rows[1 + k] = ",".join([*cells[:4], "", "", "", *cells[7:]])
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior="\n".join(rows) + "\n")
    assert_is_the_block(bundle(block, points), OF)


def test_without_any_angles_there_is_no_start(tmp_path: Path) -> None:
    exterior = exterior_rows(OF, None, tail=",0.1,0.1,0.1", head=",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior=exterior)
    with pytest.raises(GeometryError, match="no image has a starting orientation"):
        bundle(block, points)
    assert_is_the_block(bundle(block, points, start(OF, block)), OF)


def test_an_image_that_is_not_oriented_takes_its_position_with_it(tmp_path: Path) -> None:
    """Its two image points tell nothing; its observed position, wrong by a kilometre, must do no harm."""
    kept = (OF.image != 3) | np.isin(OF.point, OF.point[OF.image == 3][:1])
    of = replace(OF, image=OF.image[kept], point=OF.point[kept], xy_mm=OF.xy_mm[kept])
    wrong = OF.position_m.copy()
    wrong[3] += 1000.0
    exterior = exterior_rows(of, angles_deg(OF, "omega-phi-kappa"), wrong, ",0.1,0.1,0.1", ",sX,sY,sZ")
    block, points = read(tmp_path, of, ground=ground_rows(of, CORNERS), exterior=exterior)
    heard = Heard()
    found = bundle(block, points, context=heard)
    assert found.images.oriented.tolist() == [True, True, True, False, True, True]
    others = [k for k in range(6) if k != 3]
    np.testing.assert_allclose(found.images.position_m[others], OF.position_m[others], rtol=0, atol=1e-6)
    assert found.residuals.image[rows_of(found, "position")].tolist() == [f"i{k}" for k in others]
    assert any("i3" in line for line in heard.warned)


def test_two_image_points_and_a_position_orient_an_image(tmp_path: Path) -> None:
    """Three observed coordinates and four image coordinates for six unknowns."""
    mine = OF.point[OF.image == 3]
    kept = (OF.image != 3) | np.isin(OF.point, mine[[0, -1]])
    of = replace(OF, image=OF.image[kept], point=OF.point[kept], xy_mm=OF.xy_mm[kept])
    exterior = exterior_rows(of, angles_deg(OF, "omega-phi-kappa"), None, ",0.1,0.1,0.1", ",sX,sY,sZ")
    block, points = read(tmp_path, of, ground=ground_rows(of, CORNERS), exterior=exterior)
    assert_is_the_block(bundle(block, points), of)
