"""`aatri export` and `aatri convert`: blocks as measured, solutions corrected, other programs' files without a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.cli.main import app
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from aatri.formats.registry.sources import read_source
from aatri.pipeline.store import run_folder as store
from aatri.progress import SILENT
from tests.made_solutions import made_block
from tests.reading import read_wucaps
from tests.report.test_page import made_artifacts, make_run

PIPELINE = """run: out
seed: 2
stages:
  block: {use: block/simulate, with: {preset: uav, flight: {strips: 2, images_per_strip: 4},
                                     ties: {random_per_image: 60.0}}}
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
    assert "WuCAPS has no place for: start values of points (38)" in done.stderr
    again = read_wucaps(tmp_path / "corrected")
    m = store.load(tmp_path / "out", "refined", ImagePoints).measurements
    np.testing.assert_allclose(np.sort(again.image_points.xy[:, 0]), np.sort(m.xy_mm[m.active, 0]), rtol=1e-13)
    assert again.cameras.principal_point_mm.tolist() == [[0.0, 0.0]]


BUNDLE = """# Bundle file v0.3
2 2
1000 0.01 0
1 0 0
0 1 0
0 0 1
0 0 0
1000 0.01 0
1 0 0
0 1 0
0 0 1
-1 0 0
0.5 0.25 -10
0 0 0
2 0 0 50.0 25.0 1 0 -50.0 25.0
0.5 -0.25 -10
0 0 0
2 0 1 50.0 -25.0 1 1 -50.0 -25.0
"""


@pytest.mark.parametrize("to", ["colmap", "bal", "nvm", "opensfm", "metashape", "opf", "blocksexchange", "micmac"])
def test_files_of_another_program_are_converted_without_a_run(tmp_path: Path, to: str) -> None:
    (tmp_path / "bundle.out").write_text(BUNDLE)
    done = _aatri("convert", str(tmp_path / "bundle.out"), str(tmp_path / "out"), "--to", to, "--lens-misfit", "0.5")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.strip() == str(tmp_path / "out")
    assert "Bundler bundle.out" in done.stderr
    again = _aatri("convert", str(tmp_path / "out"), str(tmp_path / "again"), "--to", "table")
    assert again.exit_code == 0, again.stderr
    rows = (tmp_path / "again" / "orientations.txt").read_text().splitlines()[1:]
    positions = sorted([float(word) for word in row.split()[1:4]] for row in rows)
    np.testing.assert_allclose(positions, [[0, 0, 0], [1, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--to", "colmpa"), "no format 'colmpa' - did you mean 'colmap'"),
        (("--to", "gama"), "is read, not written"),
        (("--to", "table", "--angle", "degrees"), "--angle: Input should be 'deg', 'gon' or 'rad'"),
        (("--to", "table", "--columns", "image X Y Q"), "'Q' is no column"),
        (("--to", "table", "--columns", "point X Y Z"), "no list of orientations"),
    ],
)
def test_what_cannot_be_written_is_told_and_leaves_nothing(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "bundle.out").write_text(BUNDLE)
    done = _aatri("convert", str(tmp_path / "bundle.out"), str(tmp_path / "out"), *arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("measured", [False, True])
def test_a_solution_is_written_free_of_its_corrections_or_as_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: bool
) -> None:
    """Measured: the image points of the block itself, from the upper left corner; else others, without distortion."""
    monkeypatch.chdir(tmp_path)
    Path("pipeline.yaml").write_text(PIPELINE, encoding="utf-8")
    assert _aatri("run", "-q").exit_code == 0
    done = _aatri("export", "out", "blocksexchange", "x", *(["--measured"] if measured else []))
    assert done.exit_code == 0, done.stderr
    block = store.load(tmp_path / "out", "block", Block)
    again = assembled([read_source(tmp_path / "x" / "block.xml", Reading(), SILENT)])
    assert sorted(again.images.id) == sorted(block.images.id)
    of_block = np.sort(block.image_points.xy[block.image_points.active, 0])
    of_file = np.sort(again.image_points.xy[:, 0]) + 0.5  # it counts from the centre of the first pixel
    same = len(of_file) == len(of_block) and np.abs(of_file - of_block).max() < 1e-9
    assert same == measured
    assert bool(np.nan_to_num(again.camera_parameters.value).any()) == measured


# `aatri plot`: pictures by name as files of three formats.


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return make_run(tmp_path / "run", made_artifacts(made_block(columns=6)))


def test_pictures_are_listed_and_a_wrong_name_is_answered(run: Path) -> None:
    listed = CliRunner().invoke(app, ["plot", str(run)])
    assert listed.exit_code == 0
    assert {"plan", "differences_height", "ties", "angles"} <= {line.split()[0] for line in listed.stdout.splitlines()}
    wrong = CliRunner().invoke(app, ["plot", str(run), "plann"])
    assert wrong.exit_code == 2
    assert "did you mean 'plan'" in wrong.output


@pytest.mark.slow
@pytest.mark.parametrize(("form", "begin"), [("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_a_picture_is_a_file_and_the_same_each_time(run: Path, tmp_path: Path, form: str, begin: bytes) -> None:
    pytest.importorskip("matplotlib")
    names = ["plan", "angles", "ties"] if form == "svg" else ["plan"]
    made = []
    for folder in ("a", "b"):
        done = CliRunner().invoke(app, ["plot", str(run), *names, "--format", form, "--into", str(tmp_path / folder)])
        assert done.exit_code == 0, done.output
        made.append({file.name: file.read_bytes() for file in (tmp_path / folder).iterdir()})
    assert made[0] == made[1]
    assert all(content.startswith(begin) for content in made[0].values())
    assert f"plan.{form}" in made[0]
