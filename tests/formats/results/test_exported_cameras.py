"""A distortion of zeros is none: such a block is written for other programs; one with numbers is refused as before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.formats.bal.writer import write_bal_problem
from aatri.formats.colmap.reader import read_colmap
from aatri.formats.colmap.writer import write_colmap_model
from aatri.formats.dbat.reader import read_dbat
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.interior_orientation.calibrated import calibrated


@pytest.fixture(scope="module")
def made(shared_data: Path) -> tuple[Block, Solution]:
    folder = shared_data / "dbat" / "sxb"
    block = read_dbat(folder / "w-op0-no-orient-pmexport.txt", folder / "ctrlpts-weighted.txt")
    assert block.cameras.distortion.tolist() == ["brown"]
    return block, bundle(block, calibrated(block))


def test_a_real_block_whose_distortion_is_zero_is_written_for_colmap_and_read_back(
    made: tuple[Block, Solution], tmp_path: Path
) -> None:
    block, solution = made
    write_colmap_model(solution, block, tmp_path / "model", image_points=calibrated(block))
    again = read_colmap(tmp_path / "model", max_reject_share=0.1)  # one point is seen once, and no control there
    assert sorted(again.images.id) == sorted(block.images.id)
    np.testing.assert_allclose(again.cameras.principal_distance_mm / again.cameras.pixel_size_mm[:, 0],
                               block.cameras.principal_distance_mm / block.cameras.pixel_size_mm[:, 0])  # fmt: skip


def test_with_a_number_it_is_refused(made: tuple[Block, Solution], tmp_path: Path) -> None:
    block, solution = made
    given = block.camera_parameters
    wrong = replace(given, value=np.where(given.name == "k1", 1e-9, given.value))
    with pytest.raises(InputError, match="distortion brown is a correction"):
        write_colmap_model(solution, replace(block, camera_parameters=wrong), tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_a_refused_export_leaves_no_folder_behind(made: tuple[Block, Solution], tmp_path: Path) -> None:
    block, solution = made
    given = block.camera_parameters
    wrong = replace(block, camera_parameters=replace(given, value=np.where(given.name == "k1", 1e-9, given.value)))
    with pytest.raises(InputError):
        write_bal_problem(solution, wrong, tmp_path / "bal" / "problem.txt")
    assert not (tmp_path / "bal").exists()
    assert write_bal_problem(solution, block, tmp_path / "bal" / "problem.txt") == [tmp_path / "bal" / "problem.txt"]
