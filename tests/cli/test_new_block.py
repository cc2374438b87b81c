"""Templates of a block folder are a block once images, points and control are filled in, whatever is left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from aatri.cli.main import app
from aatri.errors import AatriError
from aatri.formats.tables.reader import read_block as read
from aatri.formats.tables.source import FILES
from aatri.formats.tables.writer import write_block
from tests.formats.opensfm.made_project import write_project
from tests.made_photographs import exif_of
from tests.reading import read_block
from tests.stages.chain import simulated


def _made(tmp_path: Path, block: str = "tables") -> Path:
    result = CliRunner().invoke(app, ["new", str(tmp_path), "--block", block])
    assert result.exit_code == 0, result.stderr
    return tmp_path / "block"


def test_every_file_of_the_contract_has_a_template(tmp_path: Path) -> None:
    assert {path.name for path in _made(tmp_path, "film").iterdir()} == set(FILES)
    assert "block/tables" in (tmp_path / "pipeline.yaml").read_text()


def test_what_is_given_decides_what_is_asked(tmp_path: Path) -> None:
    for block, camera, interior in (
        ("tables", "image_coordinates: pixel", "interior_orientation/calibrated"),
        ("film", "image_coordinates: comparator", "interior_orientation/affine"),
        ("reduced", "image_coordinates: photo", "interior_orientation/calibrated"),
    ):
        folder = _made(tmp_path / block, block)
        settings = (folder / "block.yaml").read_text()
        assert camera in settings
        assert interior in (tmp_path / block / "pipeline.yaml").read_text()
        assert (folder / "fiducials.csv").exists() == (block == "film")
        assert ("    pixel: {" in settings) == (block == "tables")
        assert ("    fiducials: {" in settings) == (block == "film")
        with pytest.raises(AatriError, match=r"images.csv: no rows"):
            read_block(folder)


def test_the_sample_is_that_of_the_tutorial_and_is_read(tmp_path: Path) -> None:
    assert CliRunner().invoke(app, ["new", str(tmp_path), "--block", "sample"]).exit_code == 0
    assert len(read_block(tmp_path / "quarry").images) == 15


def test_the_templates_say_what_to_fill_in(tmp_path: Path) -> None:
    with pytest.raises(AatriError, match=r"images.csv: no rows"):
        read_block(_made(tmp_path))


def test_the_commented_rows_of_the_templates_are_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aatri.checks.as_read.angles.contradiction", lambda *_, **__: None)  # rows of no real block
    folder = _made(tmp_path)
    for name in ("images", "image_points", "ground_points", "exterior"):
        path = folder / f"{name}.csv"
        lines = path.read_text().splitlines()
        example = next(line[2:] for line in lines if line.startswith("# ") and line.count(",") == lines[-1].count(","))
        more = [example.replace("p1", p) for p in ("p1", "p2", "p3")] if "p1" in example else [example]
        if name == "image_points":
            more = [row.replace("1200.5", f"{1000 * k + 200}.5") for k, row in enumerate(more)]
        if name == "ground_points":
            more = [row.replace("1000.00", f"{1000 + 100 * k}.00") for k, row in enumerate(more)]
        path.write_text("\n".join([*lines, *more]) + "\n")
    block = read_block(folder)
    assert block.images.id.tolist() == ["i1"]
    assert len(block.image_points) == len(block.ground_points) == 3
    assert block.exterior.position_use.tolist() == [1]
    assert len(block.geodetic) == len(block.relative_control) == 0


def _filled(folder: Path, *changes: tuple[str, str]) -> Path:
    """The sample, with another block.yaml."""
    assert CliRunner().invoke(app, ["new", str(folder), "--block", "sample"]).exit_code == 0
    path = folder / "quarry" / "block.yaml"
    text = path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return folder / "quarry"


def test_coordinates_of_a_map_in_a_local_frame_are_asked_about(tmp_path: Path) -> None:
    told: list[str] = []
    reporter = SimpleNamespace(log=lambda _: None, warn=told.append, progress=lambda *_: None)
    read(_filled(tmp_path / "stated"), reporter)
    assert told == []
    read(_filled(tmp_path / "asked", ("earth_curvature: ignore", "#")), reporter)
    (question,) = told
    assert "block.yaml:6:" in question
    assert "is this a map?" in question
    assert "E 5002" in question


@pytest.mark.parametrize(("kind", "idle"), [("digital", "origin and y bear"), ("film", "size, origin and y bear")])
def test_pixels_of_photo_coordinates_are_said_to_bear_on_nothing(tmp_path: Path, kind: str, idle: str) -> None:
    """The example of the contract has them, so that they are no error. A digital camera has its format in pixels."""
    told: list[str] = []
    reporter = SimpleNamespace(log=told.append, warn=lambda _: None, progress=lambda *_: None)
    changes = ("image_coordinates: pixel", "image_coordinates: photo"), ("kind: digital", f"kind: {kind}")
    read(_filled(tmp_path, *changes), reporter)
    assert any(f"pixel: {idle} on nothing" in line for line in told)


@pytest.mark.parametrize(("unit", "idle"), [("mm", True), ("px", False)])
def test_the_size_of_pixels_is_said_to_bear_on_nothing_unless_standard_deviations_are_in_pixels(
    tmp_path: Path, unit: str, idle: bool
) -> None:
    told: list[str] = []
    reporter = SimpleNamespace(log=told.append, warn=lambda _: None, progress=lambda *_: None)
    in_mm = ("image_coordinates: pixel", "image_coordinates: photo"), ("kind: digital", "kind: film")
    changes = (", origin: top-left-corner, y: down", ""), ("sigma_image: mm", f"sigma_image: {unit}")
    read(_filled(tmp_path, *in_mm, *changes), reporter)
    assert any("pixel: size bears on nothing" in line for line in told) == idle


def test_photographs_without_positions_are_adjusted_as_a_free_model(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image").new("L", (64, 48))
    for name, exif in (("placed", exif_of(np.array([0.0, 0.0, 100.0]))), ("bare", None)):
        (tmp_path / name).mkdir()
        image.save(tmp_path / name / "1.jpg", **({"exif": exif} if exif is not None else {}))
        made = CliRunner().invoke(app, ["new", str(tmp_path / f"of {name}"), str(tmp_path / name), "--block", "photos"])
        assert made.exit_code == 0, made.stderr
        text = (tmp_path / f"of {name}" / "pipeline.yaml").read_text()
        assert ("datum: free, " in text) == (name == "bare")
    nowhere = CliRunner().invoke(app, ["new", str(tmp_path / "p"), str(tmp_path / "none"), "--block", "photos"])
    assert nowhere.exit_code == 3
    assert not (tmp_path / "p").exists()


@pytest.mark.slow
@pytest.mark.parametrize("in_strips", [True, False])
@pytest.mark.parametrize(("coordinates", "corrected"), [("comparator", True), ("photo", False)])
def test_of_a_block_folder_the_corrections_are_those_of_block_yaml(
    tmp_path: Path, coordinates: str, corrected: bool, in_strips: bool
) -> None:
    """Photo coordinates are reduced already; comparator coordinates and pixels nobody has corrected."""
    flight = {"strips": 2, "images_per_strip": 3, "cross_strips": 0}
    block = simulated(5, preset="rc30", flight=flight, ties={"new_points": 40}, known={"full": 6})
    cameras = replace(block.cameras, image_coordinates=np.array([coordinates]))
    images = block.images if in_strips else replace(block.images, strip=np.full(6, -1, dtype=np.int32))
    write_block(replace(block, cameras=cameras, images=images), tmp_path / "film")
    made = CliRunner().invoke(app, ["new", str(tmp_path / "p"), "--from", str(tmp_path / "film")])
    refined = (
        (tmp_path / "p" / "pipeline.yaml")
        .read_text()
        .partition("refined:")[2]
        .partition("\n  models:" if in_strips else "\n  initial:")[0]
    )
    assert ("false" not in refined) == corrected, made.stderr


# Arguments of `aatri new` that say two things at once are refused, not dropped.


def invoked(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["new", *(str(a) for a in arguments)])


def _refused(*arguments: object) -> str:
    result = invoked(*arguments)
    assert result.exit_code == 2, result.stderr
    return " ".join(result.stderr.split())


def test_a_source_is_not_taken_for_the_folder_to_write_to(tmp_path: Path) -> None:
    """Of `--from A B C` the command line takes B for FOLDER."""
    folder = write_project(tmp_path / "odm")
    flight, other = tmp_path / "positions.txt", tmp_path / "flight"
    flight.write_text("image X Y Z\nIMG_0.JPG 0 0 100\n")
    (other / "day_1").mkdir(parents=True)
    (other / "day_1" / "positions.txt").write_text(flight.read_text())
    for words in (("--from", folder, flight, other), ("--from", folder, other, flight), ("--from", folder, other)):
        assert "FOLDER comes before --from: `aatri new FOLDER --from A B C`" in _refused(*words)
    assert not (other / "pipeline.yaml").exists()


def test_a_folder_that_is_empty_or_has_the_source_or_is_this_one_is_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_project(tmp_path / "odm" / "opensfm")
    (tmp_path / "empty" / ".git").mkdir(parents=True)
    (tmp_path / "empty" / ".git" / "HEAD").write_text("ref\n")
    (tmp_path / "empty" / ".gitignore").write_text("runs\n")
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "notes.txt").write_text("notes\n")
    for target in (tmp_path / "empty", tmp_path / "odm"):
        result = invoked(target, "--from", folder)
        assert result.exit_code == 0, result.stderr
    monkeypatch.chdir(tmp_path / "here")
    assert invoked("--from", folder).exit_code == 0
    assert "is there already" in _refused("--from", folder)


def test_options_beside_those_that_they_do_not_go_with_are_refused(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm")
    target = tmp_path / "o"
    assert "a second path" in _refused(target, tmp_path / "a", tmp_path, "--block", "photos")
    for block in ("film", "simulate"):
        assert "leave --block out" in _refused(target, "--from", folder, "--block", block)
    for words in (["--set", "crs=EPSG:25832"], ["--without", "a.txt"], ["--lens-misfit", "1"]):
        assert "go with --from" in _refused(target, *words)
    plugin = ["--plugin", "interior_orientation/mine"]
    for words in ([tmp_path / "a"], ["--from", folder], ["--block", "film"], ["--set", "crs=EPSG:25832"]):
        assert "--plugin beside a block" in _refused(target, *words, *plugin)
    assert not target.exists()
