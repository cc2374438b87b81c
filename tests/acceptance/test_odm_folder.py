"""A folder of OpenDroneMap by the command line: reconstruction, tracks, gcp_list.txt, to a statement of accuracy."""

from __future__ import annotations

import json
from pathlib import Path

import pyproj
import pytest

from tests.acceptance.small_block import aatri
from tests.formats.opensfm.made_project import HEIGHT, HEIGHT_PX, LATITUDE, LONGITUDE, WIDTH, write_project


def gcp_list(folder: Path) -> str:
    """Eight points of the reconstruction as control in UTM, where `tracks.csv` shows them, px from the first pixel."""
    points = json.loads((folder / "reconstruction.json").read_text())[0]["points"]
    horizon = f"+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lat_0={LATITUDE} +lon_0={LONGITUDE}"
    to_map = pyproj.Transformer.from_pipeline(
        f"{horizon} +h_0={HEIGHT} +step +inv +proj=cart +ellps=WGS84 +step +proj=utm +zone=32 +ellps=WGS84"
    )
    rows = ["EPSG:32632"]
    for line in (folder / "tracks.csv").read_text().splitlines()[1:]:
        image, track, _, x, y, *_ = line.split("\t")
        if int(track) % 3 == 0:
            place = " ".join(f"{v:.4f}" for v in to_map.transform(*points[track]["coordinates"]))
            column, row = float(x) * WIDTH + (WIDTH - 1) / 2, float(y) * WIDTH + (HEIGHT_PX - 1) / 2
            rows.append(f"{place} {column:.3f} {row:.3f} {image} G{track}")
    return "\n".join(rows) + "\n"


def test_an_odm_folder_becomes_a_statement_of_accuracy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_project(tmp_path / "odm")
    (folder / "gcp_list.txt").write_text(gcp_list(folder))
    monkeypatch.chdir(tmp_path)
    made = aatri("new", "mine", "--from", folder)
    assert made.exit_code == 0, made.stderr
    result = aatri("run", "mine/pipeline.yaml", "-q")
    assert result.exit_code == 0, result.stderr
    metrics = json.loads(aatri("metrics", "mine/runs/block", "--json").stdout)
    assert metrics["bundle"]["sigma0"] < 0.05  # the files are exact but for their digits; 1 px is taken for them
    assert aatri("export", "mine/runs/block", "tables", "out").exit_code == 0
