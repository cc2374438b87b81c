"""Fiducial marks follow from each other; a click makes the stages stale that it bears on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from aatri.measuring.centres import place_of_mark
from aatri.measuring.session import Session
from tests.measuring.made_folder import made_folder

FILM = """\
aatri_block: 1
frames: {map: {axes: [east, north, up], crs: local}}
units: {ground: m, angle: deg, sigma_image: um}
sigma: {control: [0.02, 0.02, 0.02]}
cameras:
  f: {kind: film, image_coordinates: pixel, pixel: {size: 0.02, origin: top-left-corner, y: down}, format: [14, 10],
      principal_distance: 100.0, fiducials: {"1": [-6, -4], "2": [6, -4], "3": [6, 4], "4": [-6, 4.5]}}
"""
PIPELINE = """\
run: run
seed: 1
stages:
  block:    {use: block/tables, with: {path: block}}
  interior: {use: interior_orientation/calibrated, from: {block}}
"""


def _film(folder: Path) -> Session:
    made_folder(folder)
    (folder / "block.yaml").write_text(FILM)
    (folder / "images.csv").write_text("image,camera,path\na,f,a.png\n")
    return Session(folder)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_mark_lies_where_three_others_tell(mirrored: bool) -> None:
    film = [-6 - 4j, 6 - 4j, 6 + 4j, -6 + 4.5j]
    turn = 50 * np.exp(0.3j)
    scan = [turn * (w if mirrored else np.conj(w)) + (350 + 250j) for w in film]
    assert place_of_mark(film[3], list(zip(film[:3], scan[:3]))) == pytest.approx(scan[3])
    assert place_of_mark(film[3], list(zip(film[:1], scan[:1]))) is None


def test_two_marks_tell_where_the_others_are(tmp_path: Path) -> None:
    session = _film(tmp_path)
    assert session.marks("a") == {"places": []}
    for name, x, y in (("1", 50.0, 450.0), ("2", 650.0, 450.0)):
        session.measure("fiducial", "a", name, "", x, y)
    places = {place["name"]: place for place in session.marks("a")["places"]}
    assert (places["3"]["x"], places["3"]["y"]) == pytest.approx((650.0, 50.0))
    session.measure("fiducial", "a", "3", "", 650.5, 50.0)
    session.measure("fiducial", "a", "4", "", 50.0, 25.0)
    places = {place["name"]: place for place in session.marks("a")["places"]}
    assert places["3"]["residual"] == pytest.approx([0.5, 0.0], abs=1e-6)


def test_without_a_default_a_click_has_a_standard_deviation_of_half_a_pixel(tmp_path: Path) -> None:
    session = _film(tmp_path)
    session.measure("fiducial", "a", "1", "", 50.0, 450.0)
    text = session.folder.marks.path.read_text()
    assert text == "image,fiducial,x,y,sx,sy\na,1,50.0000,450.0000,10,10\n"  # 0.5 px of 20 um


@pytest.mark.slow
def test_a_click_makes_the_stages_stale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(made_folder(tmp_path / "block"))
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    monkeypatch.chdir(tmp_path)
    for image in ("a", "b"):
        for k, name in enumerate(("G1", "P2", "P3")):
            session.measure("point", image, name, "", 100.0 + 50 * k, 50.0 + 9 * k * k)
    first = CliRunner().invoke(app, ["run"])
    assert first.exit_code == 0, first.output
    assert "stale" not in CliRunner().invoke(app, ["status"]).output
    session.measure("point", "a", "P2", session.folder.points.of_image("a")[1].line, 300.0, 200.0)
    assert "stale" in CliRunner().invoke(app, ["status"]).output


def test_a_folder_that_is_none_is_told(tmp_path: Path) -> None:
    for path, sentence in ((tmp_path / "no", "does not exist"), (tmp_path, "block.yaml")):
        told = CliRunner().invoke(app, ["measure", str(path)])
        assert told.exit_code == 3
        assert sentence in told.output
