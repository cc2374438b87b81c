"""Photographs to an adjusted block: from EXIF alone, with a focal length that is 12 % wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import aatri
from aatri.pipeline.run import items
from tests.made_photographs import EAST_M, F_PX, HEIGHT, NORTH_M, WIDTH, flown, relief

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


@pytest.mark.slow
def test_photographs_beside_a_list_of_control_end_in_what_control_agrees_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A list of OpenDroneMap, in pixels from the centre of the first; control of 5 mm, marks of 0.3 px.

    The photographs above are looked at in several processes, these in this one.
    """
    from aatri.cli.main import app

    monkeypatch.setattr(items, "processes_of_a_stage", lambda: 1)

    photos, rng = flown(tmp_path / "photos", per_strip=2), np.random.default_rng(3)
    rows = ["EPSG:32632"]
    for xy in ((5.0, 0.0), (60.0, -5.0), (30.0, 18.0), (5.0, 35.0), (62.0, 40.0)):
        X = np.array([*xy, relief(*np.array(xy))])
        surveyed = X + np.array([EAST_M, NORTH_M, 0.0]) + rng.normal(0, 0.005, 3)
        place = " ".join(f"{v:.3f}" for v in surveyed)
        for name, position, R in zip(photos.names, photos.position_m, photos.ground_from_image):
            u = R.T @ (X - position)
            at = np.array([WIDTH - 1, HEIGHT - 1]) / 2 + F_PX * np.array([-u[0], u[1]]) / u[2] + rng.normal(0, 0.3, 2)
            if (at > 0).all() and (at < [WIDTH, HEIGHT]).all():
                rows.append(f"{place} {at[0]:.2f} {at[1]:.2f} {name}.jpg g{xy[0]:.0f}_{xy[1]:.0f}")
    (tmp_path / "gcp_list.txt").write_text("\n".join(rows) + "\n")
    sources = ["--from", str(photos.folder), "--from", str(tmp_path / "gcp_list.txt")]
    result = CliRunner().invoke(app, ["new", str(tmp_path / "b"), *sources])
    assert result.exit_code == 0, result.output
    pipeline = tmp_path / "b" / "pipeline.yaml"
    stages = yaml.safe_load(pipeline.read_text())["stages"]
    assert stages["block"] == {"use": "tie_points/sift", "from": {"block": "photos"}}
    text = pipeline.read_text().replace("control_sigma: [0.0, 0.0, 0.0]", "control_sigma: [0.01, 0.01, 0.01]")
    pipeline.write_text(text)
    bundle = aatri.run(pipeline)["bundle"].artifact
    off = bundle.images.position_m - photos.position_m - [EAST_M, NORTH_M, 0.0]
    assert np.abs(off).max() < 0.1
