"""Photographs to an adjusted block: from EXIF alone, with a focal length that is 12 % wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import aatri
from tests.made_photographs import EAST_M, F_PX, NORTH_M, flown

pytest.importorskip("cv2")


@pytest.mark.slow
def test_photographs_give_the_orientations_they_were_taken_with(tmp_path: Path) -> None:
    from aatri.cli.main import app

    photos = flown(tmp_path / "photos")
    result = CliRunner().invoke(app, ["new", str(tmp_path / "b"), str(photos.folder), "--block", "photos"])
    assert result.exit_code == 0, result.output
    pipeline = tmp_path / "b" / "pipeline.yaml"
    assert yaml.safe_load(pipeline.read_text())["stages"]["photos"]["with"]["path"] == "../photos"
    run = aatri.run(pipeline)
    block, bundle = run["block"].artifact, run["bundle"].artifact
    assert (block.images.id == photos.names).all()
    c_px = bundle.cameras.principal_distance_mm[0] / block.cameras.pixel_size_mm[0, 0]
    assert abs(c_px / F_PX - 1) < 0.01
    off = bundle.images.position_m - photos.position_m - [EAST_M, NORTH_M, 0.0]
    assert np.abs(off).max() < 0.25  # RTK of 0.02, 0.02, 0.04 m
    R = bundle.images.ground_from_image
    trace = np.einsum("nij,nij->n", R, photos.ground_from_image)
    assert np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1))).max() < 0.3
    assert bundle.observations > 5000
