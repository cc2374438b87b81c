"""Real blocks with a wrong unit, constant or sign: said as the block is read, before anything is adjusted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import screened
from aatri.errors import AatriError
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.reading import read_dbat, read_wucaps
from tests.stages.film_blocks import Told


@pytest.fixture(scope="module")
def film(shared_data: Path) -> Block:
    """Six photographs with their marks, without format and positions."""
    return read_wucaps(shared_data / "rc30_2x3" / "Data" / "bundle_ajustment")


@pytest.fixture(scope="module")
def digital(shared_data: Path) -> Block:
    """Seven digital images of 520 m above flat ground, 16 control points with a relief of 1.85 m."""
    folder = shared_data / "dbat" / "sxb"
    return read_dbat(folder / "w-op0-no-orient-pmexport.txt", folder / "ctrlpts-weighted.txt")


def _said(block: Block) -> str:
    heard = Told()
    try:
        screened(block, heard)
    except AatriError as error:
        return str(error)
    return "\n".join(heard.warnings)


def _image_times(block: Block, factor: float) -> Block:
    return replace(block, image_points=replace(block.image_points, xy=factor * block.image_points.xy))


def _c_times(block: Block, factor: float) -> Block:
    c = block.cameras
    return replace(block, cameras=replace(c, principal_distance_mm=factor * c.principal_distance_mm))


def _control_times(block: Block, factor: object) -> Block:
    g = block.ground_points
    return replace(block, ground_points=replace(g, xyz_m=g.xyz_m * np.asarray(factor)))


def test_as_they_are_nothing_is_said(film: Block, digital: Block) -> None:
    assert not _said(film)
    assert not _said(digital)


@pytest.mark.parametrize("factor", [1e-3, 1 / 25.4, 1e3])
def test_image_coordinates_in_another_unit(film: Block, digital: Block, factor: float) -> None:
    assert "check the unit of the image coordinates" in _said(_image_times(film, factor))
    assert "image coordinates" in _said(_image_times(digital, factor)) or factor > 1
    assert _said(_image_times(digital, factor))


def test_a_principal_distance_in_metres(film: Block, digital: Block) -> None:
    assert "field of view of 180 deg" in _said(_c_times(film, 1e-3))
    assert "check principal_distance" in _said(_c_times(digital, 1e-3))


def test_control_in_millimetres(film: Block, digital: Block) -> None:
    assert ": a scale of 1 : 2," in _said(_control_times(film, 1e3))  # without positions nothing else can tell
    assert "divided by 1000" in _said(_control_times(digital, 1e3))


def _relief(block: Block) -> list[str]:
    heard = Told()
    bundle(block, calibrated(block), context=heard)
    return [text for text in heard.warnings if "times their relief" in text]


@pytest.mark.parametrize("factor", [1 / 0.3048, -1.0])
def test_heights_of_control_alone_are_told_by_a_bundle_that_starts_from_given_orientations(
    digital: Block, factor: float
) -> None:
    (text,) = _relief(_control_times(digital, [1.0, 1.0, factor]))
    found, sigma = text.split("images with ")[1].split(" times")[0].split(" (+- ")
    assert abs(float(found) - 1 / factor) < 3 * float(sigma.rstrip(")"))


def test_of_heights_that_fit_no_factor_is_told(digital: Block) -> None:
    assert not _relief(digital)
