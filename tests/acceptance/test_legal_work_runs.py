"""Real blocks that readers once refused run through, with the figures that others have published of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from aatri.artifacts.block import Block
from aatri.artifacts.block_tables import FiducialPoints, Fiducials
from aatri.artifacts.solution import Solution
from aatri.cli.main import app
from aatri.formats.tables.writer import write_block
from aatri.tables import hdf5
from tests.formats.dbat.dbat_report import DbatReport, read_report
from tests.made_uav_3strips import block_folder
from tests.reading import read_dbat, read_wucaps

pytestmark = pytest.mark.slow

CHAIN = """\
run: out
stages:
  block:    {use: block/tables, with: {path: block}}
  interior: {use: interior_orientation/affine, from: {block}}
  refined:  {use: image_refinement/systematic, from: {block, image_points: interior},
             with: {refraction: false, earth_curvature: false}}
  models:   {use: relative_orientation/dependent, from: {block, image_points: refined}}
  strips:   {use: strip_formation/scale_transfer, from: {block, models}}
  absolute: {use: absolute_orientation/similarity, from: {block, strips, image_points: refined}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: refined, initial: absolute},
             with: {interior_unknowns: false, blunders: none}}
  accuracy: {use: accuracy/evaluation, from: {block, solution: bundle}}
"""
BUNDLE = """\
run: out
stages:
  block:    {use: BLOCK}
  interior: {use: interior_orientation/calibrated, from: {block}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: interior},
             with: {blunders: none, tolerance: 1.0e-8}}
  accuracy: {use: accuracy/evaluation, from: {block, solution: bundle}}
"""
UNORDERED = """\
run: out
stages:
  block:    {use: block/tables, with: {path: block}}
  interior: {use: interior_orientation/calibrated, from: {block}}
  initial:  {use: initial_orientation/graph, from: {block, image_points: interior}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: interior, initial}}
"""


def _metrics(folder: Path, pipeline: str) -> dict[str, Any]:
    """Figures of the bundle and of its accuracy after `aatri run`."""
    folder.mkdir(exist_ok=True)
    (folder / "pipeline.yaml").write_text(pipeline, encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(folder / "pipeline.yaml"), "--into", str(folder / "out"), "--json"])
    assert done.exit_code == 0, done.output
    return {name: value for stage in json.loads(done.stdout)["stages"] for name, value in stage["metrics"].items()}


def _solution(folder: Path) -> Solution:
    return hdf5.read(folder / "out" / "current" / "bundle.h5", Solution)


def _assert_printed(apart: np.ndarray, report: DbatReport) -> None:
    """Half a unit of the last digit, and what DBAT's own criterion leaves open (tests/stages/test_bundle_dbat.py)."""
    assert (np.abs(apart) <= 6e-7 + 3e-6 * report.exterior_sigma[:, 3:]).all()


def _dbat(options: str) -> str:
    return BUNDLE.replace("BLOCK", f"block/dbat, with: {{{options}}}")


def test_real_film_measured_in_pixels_of_a_scan(tmp_path: Path, shared_data: Path) -> None:
    """The six photographs, as a scan of 21 um gives them: photo 0319's own marks tell how film lies in a scan."""
    data = shared_data / "rc30_2x3" / "Data"
    block = read_wucaps(data / "bundle_ajustment")
    rows = (data / "interior_orientation" / "0319.txt").read_text().splitlines()[7:11]
    marks = np.array([[float(cell) for cell in row.split()] for row in rows])  # xm ym mm, column row px
    design = np.column_stack([np.ones(4), marks[:, :2]])
    scan = np.linalg.lstsq(design, marks[:, 2:], rcond=None)[0]  # px of mm, an affine transformation
    write_block(_scanned(block, marks, scan), tmp_path / "block")
    found = _metrics(tmp_path, CHAIN)
    # as published of the photo coordinates themselves (README of the data)
    assert (found["image_points"], found["redundancy"]) == (63, 36)
    assert found["sigma0_um"] == pytest.approx(10.62, abs=0.005)
    measured = [found[f"check_rmse_{axis}_m"] for axis in "xyz"]
    np.testing.assert_allclose(measured, [0.187, 0.055, 0.171], atol=0.00051)


def _scanned(block: Block, marks: np.ndarray, scan: np.ndarray) -> Block:
    """Pixels of the scan, whose rows count upwards; every photograph lies a little otherwise on the scanner."""

    def pixels(xy_mm: np.ndarray, image: np.ndarray) -> np.ndarray:
        moved = 7.0 * np.column_stack([image % 3, image % 2])
        return np.asarray(np.column_stack([np.ones(len(xy_mm)), xy_mm]) @ scan + moved)

    cameras = replace(
        block.cameras,
        image_coordinates=["pixel"],
        pixel_size_mm=[[0.021] * 2],
        pixel_origin=["bottom-left-corner"],
        pixel_y=["up"],
        format=[[11129.0, 11263.0]],
    )
    points = block.image_points
    images = np.repeat(np.arange(len(block.images)), 4)
    return replace(
        block,
        cameras=cameras,
        image_points=replace(points, xy=pixels(points.xy, points.image)),
        fiducials=Fiducials(camera=np.zeros(4, int), id=["1", "2", "3", "4"], xy_mm=marks[:, :2]),
        fiducial_points=FiducialPoints(
            image=images,
            fiducial=np.tile(np.arange(4), len(block.images)),
            xy=pixels(np.tile(marks[:, :2], (len(block.images), 1)), images),
            sigma_mm=np.full((len(images), 2), 0.005),
            file=np.full(len(images), -1),
            line=np.full(len(images), -1),
        ),
    )


def test_a_block_of_control_alone_without_any_start(tmp_path: Path, shared_data: Path) -> None:
    """DBAT's aerial block has no tie point; the tables get no orientation, so that every image is resected."""
    folder = shared_data / "dbat/sxb"
    block = read_dbat(folder / "w-op0-no-orient-pmexport.txt", folder / "ctrlpts-weighted.txt")
    write_block(block, tmp_path / "block")
    (tmp_path / "block" / "exterior.csv").unlink()
    given = (tmp_path / "block" / "ground_points.csv").read_text().splitlines()
    assert not [row for row in given if "start" in row]
    found = _metrics(tmp_path, BUNDLE.replace("BLOCK", "block/tables, with: {path: block}"))
    report = read_report(folder / "w-op0-no-orient-dbatreport.txt")
    assert found["redundancy"] == report.counts[2]
    assert found["sigma0"] == pytest.approx(report.sigma0, rel=1e-6)
    offset = _solution(tmp_path).images.position_m - report.exterior[:, 3:]
    _assert_printed(offset - offset.mean(axis=0), report)


def test_an_export_for_dbat_with_standard_deviations_of_zero(tmp_path: Path, shared_data: Path) -> None:
    """All marks have 0.1 px in the report; 0 is read as 1 px, which changes sigma0 by ten and nothing else."""
    folder = shared_data / "dbat/camcal"
    lines = (folder / "camcal-pmexport.txt").read_text().splitlines()
    zero = [" ".join([*line.split()[:4], "0.0", "0.0"]) if len(line.split()) == 6 else line for line in lines]
    assert sum(a != b for a, b in zip(zero, lines)) > 1000
    (tmp_path / "zero.txt").write_text("\n".join(zero) + "\n")
    options = f"path: zero.txt, control: {folder / 'camcal-fixed.txt'}, camera_model: dbat3, calibrate: true"
    found = _metrics(tmp_path, _dbat(options))
    report = read_report(folder / "camcal-dbatreport-model3.txt")
    assert found["redundancy"] == report.counts[2]
    assert 10 * found["sigma0"] == pytest.approx(report.sigma0, rel=1e-5)
    _assert_printed(_solution(tmp_path).images.position_m - report.exterior[:, 3:], report)


def test_a_dbat3_camera_exported_and_read_back(tmp_path: Path, shared_data: Path) -> None:
    """`aatri export` of the block, and the bundle of what was exported: the digits of DBAT's report again."""
    folder = shared_data / "dbat/camcal"
    options = (
        f"path: {folder / 'camcal-pmexport.txt'}, control: {folder / 'camcal-fixed.txt'}, "
        "camera_model: dbat3, calibrate: true"
    )
    first = _metrics(tmp_path / "first", _dbat(options))
    target = tmp_path / "second" / "block"
    target.parent.mkdir()
    done = CliRunner().invoke(app, ["export", f"{tmp_path / 'first' / 'out'}:block", "tables", str(target)])
    assert done.exit_code == 0, done.output
    second = _metrics(tmp_path / "second", BUNDLE.replace("BLOCK", "block/tables, with: {path: block}"))
    assert second["redundancy"] == first["redundancy"]
    report = read_report(folder / "camcal-dbatreport-model3.txt")
    assert second["sigma0"] == pytest.approx(report.sigma0, rel=1e-5)
    _assert_printed(_solution(tmp_path / "second").images.position_m - report.exterior[:, 3:], report)


@pytest.mark.parametrize("wrong_mm", ["3.58759", "3.69631"])  # -1 %, +2 %
def test_a_principal_distance_that_is_wrong_is_named_on_real_images_and_no_control_goes_for_it(
    tmp_path: Path, shared_data: Path, wrong_mm: str
) -> None:
    """Three oblique strips, gross errors among their matches; calibrated: c = 3.62383 mm (README of the data)."""
    block_yaml = block_folder(shared_data / "uav_3strips", tmp_path / "block") / "block.yaml"
    text = block_yaml.read_text()
    block_yaml.write_text(text.replace("principal_distance: 3.62383", f"principal_distance: {wrong_mm}"))
    (tmp_path / "pipeline.yaml").write_text(UNORDERED)
    done = CliRunner().invoke(app, ["run", str(tmp_path / "pipeline.yaml"), "-q"])
    assert done.exit_code == 6
    c_mm, sigma_mm = done.stderr.split("principal distance of ")[1].split(" mm")[0].rstrip(")").split(" (+- ")
    assert abs(float(c_mm) - 3.62383) < 3 * float(sigma_mm)
    suspects = _solution(tmp_path).suspects
    assert not (suspects.kind[suspects.staying_out] == "control").any()
