"""block/dbat, block/bal and block/colmap as stages: options reach the reader."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from aatri.artifacts.block import CONTROL, OBSERVED_VALUE
from aatri.errors import GeometryError
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.stages.block.bal import BalOptions, bal
from aatri.stages.block.colmap import ColmapOptions, colmap
from aatri.stages.block.dbat import DbatOptions, dbat
from aatri.tables import hdf5
from aatri.tables.digest import content_digest
from tests.formats.start_solution import start_solution, write_binary


def test_dbat_refuses_undetermined_points_unless_they_are_to_be_set_aside(shared_data: Path) -> None:
    folder = shared_data / "dbat/camcal"
    given = {"path": folder / "camcal-pmexport-1ray.txt", "control": folder / "camcal-1mm.txt"}
    with pytest.raises(GeometryError, match="object point 88 is seen in one image only"):
        dbat(options=DbatOptions(**given, camera_model="dbat3"))
    options = DbatOptions(
        **given, camera_model="dbat3", calibrate=True, image_sigma_px=0.1, undetermined_points="set_aside"
    )
    block = dbat(options=options)
    assert block.rejects.reason.tolist() == ["seen in one image only"]
    assert block.cameras.distortion.tolist() == ["dbat3"]
    assert block.camera_parameters.free.all()
    assert (block.ground_points.role == CONTROL).all(axis=1).sum() == 4


@pytest.mark.slow
def test_bal_and_colmap_blocks_survive_the_artifact_file(shared_data: Path, tmp_path: Path) -> None:
    first = bal(options=BalOptions(path=shared_data / "bal/problem-49-7776-pre.txt", image_sigma_px=2.0))
    assert (first.image_points.sigma_mm == 0.002).all()
    write_binary(OrientedBlock(first, start_solution(first)), tmp_path / "model")
    second = colmap(options=ColmapOptions(path=tmp_path / "model", position_sigma=0.1, calibrate=True))
    assert (second.exterior.position_use == OBSERVED_VALUE).all()
    for block in (first, second):
        path = tmp_path / f"{block.cameras.pixel_origin[0]}.h5"
        digest = hdf5.write(block, path)
        assert content_digest(hdf5.read(path, type(block))) == digest


def test_options_out_of_range_are_refused() -> None:
    for wrong in ({"image_sigma_px": 0}, {"camera_model": "dbat2"}, {"undetermined_points": "drop"}):
        with pytest.raises(ValidationError):
            DbatOptions(path=Path("x"), **wrong)
