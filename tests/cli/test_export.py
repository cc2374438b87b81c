"""`aatri export RUN wucaps DIR`: blocks as measured, solutions with corrected photo coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from aatri.artifacts.image_points import ImagePoints
from aatri.cli.main import app
from aatri.pipeline.store import run_folder as store
from tests.reading import read_wucaps

PIPELINE = """run: out
seed: 2
stages:
  block: {use: block/simulate, with: {preset: uav, flight: {strips: 2, images_per_strip: 4}}}
  interior: {use: interior_orientation/calibrated, from: {block}}
  refined: {use: image_refinement/systematic, from: {block, image_points: interior}}
  bundle: {use: bundle_adjustment/bundle, from: {block, image_points: refined}}
"""


def _aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.slow
def test_a_block_of_pixels_is_written_for_wucaps_once_it_is_corrected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("pipeline.yaml").write_text(PIPELINE, encoding="utf-8")
    assert _aatri("run", "-q").exit_code == 0
    refused = _aatri("export", "out:block", "wucaps", "raw")
    assert refused.exit_code == 3
    assert "pixel coordinates, WuCAPS files hold photo coordinates" in refused.stderr
    assert "export a Solution" in refused.stderr
    done = _aatri("export", "out", "wucaps", "corrected")
    assert done.exit_code == 0, done.stderr
    assert "positions and attitudes have no place in WuCAPS files" in done.stderr
    again = read_wucaps(tmp_path / "corrected")
    m = store.load(tmp_path / "out", "refined", ImagePoints).measurements
    np.testing.assert_array_equal(np.sort(again.image_points.xy[:, 0]), np.sort(m.xy_mm[m.active, 0]))
    assert again.cameras.principal_point_mm.tolist() == [[0.0, 0.0]]
