"""Bad input, met as a user meets it: place, reason and remedy on the terminal, the right exit code, nothing stale.

Exit codes: 2 pipeline file, 3 input data, 4 geometry or datum. What concerns a few items only (a point seen once, an
image without points) is set aside, listed, and the run goes on.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import h5py
import pytest

from tests.acceptance.small_block import SIMULATE, STAGES, TABLES, Edit, aatri, current, lines, without, write_pipeline

POINTS, IMAGES, GROUND, EXTERIOR = "image_points.csv", "images.csv", "ground_points.csv", "exterior.csv"
BEFORE_ABSOLUTE = {"block", "interior", "refined", "models", "strips"}
ALL = BEFORE_ABSOLUTE | {"absolute", "strip_block", "bundle", "accuracy"}
FLAT = STAGES.replace(
    "image_points: interior}}",
    "image_points: interior},\n                with: {refraction: false, earth_curvature: false}}",
)
"""Without corrections that want a flying height: the datum is first asked for by the absolute orientation."""


def _fails(code: int, *parts: str) -> None:
    result = aatri("run", "-q")
    assert result.exit_code == code, result.stderr
    assert "Traceback" not in result.stderr + result.stdout
    assert "fix: " in result.stderr
    for part in parts:
        assert part in result.stderr


def _runs(*parts: str) -> None:
    result = aatri("run", "-q")
    assert result.exit_code == 0, result.stderr
    for part in parts:
        assert part in result.stderr


def _keep_control(count: int) -> Edit:
    """Keep the first control points; the check points stay."""
    kept = {f"GCP{k:02d}" for k in range(1, count + 1)}
    return lines(GROUND, lambda line: line if line.split(",")[0] in kept or line.startswith("CHK") else None)


def _no_link(line: str) -> str:
    """Image points of the second strip get ids of their own: nothing joins the strips any more."""
    image, point, rest = line.split(",", 2)
    return f"{image},second-{point},{rest}" if image.startswith("02") else line


def _on_a_line(block: Path) -> None:
    """Leave three control points of one edge of the block, which lie on a line, and no positions."""
    without(EXTERIOR)(block)
    rows = [line.split(",") for line in (block / GROUND).read_text().splitlines()[1:]]
    control = [(float(r[2]), float(r[1]), r[0]) for r in rows if r[0].startswith("GCP")]
    south = min(control)[0]
    kept = {name for y, _, name in control if y - south < 20}
    assert len(kept) >= 3
    lines(GROUND, lambda line: line if line.split(",")[0] in kept or line.startswith("CHK") else None)(block)


@pytest.mark.slow
def test_a_missing_file_is_one_error(project: Path) -> None:
    without(f"block/{IMAGES}")(project)
    result = aatri("run", "-q")
    assert result.exit_code == 3
    assert re.search(r"error: \S*block/images\.csv: does not exist\n +fix: ", result.stderr)
    assert result.stderr.count("error: ") == 1
    assert current(project) == set()


@pytest.mark.slow
def test_a_missing_block_folder_is_named(project: Path) -> None:
    shutil.rmtree(project / "block")
    _fails(3, "path is 'block', which does not exist", "mend the path")
    assert current(project) == set()


def test_an_empty_file_is_named(project: Path) -> None:
    (project / "block" / POINTS).write_text("")
    _fails(3, f"{POINTS}: the file is empty")
    assert current(project) == set()


def test_an_unknown_camera_is_named_with_line_and_the_nearest_name(project: Path) -> None:
    lines(IMAGES, lambda line: line.replace("0103,rc30", "0103,rc31"))(project / "block")
    _fails(3, f"{IMAGES}:4:6: camera 'rc31' is unknown - did you mean 'rc30'?")
    assert current(project) == set()


@pytest.mark.slow
def test_a_point_seen_once_is_rejected_listed_and_the_run_goes_on(project: Path) -> None:
    lines(POINTS, lambda line: line, more="0101,LONELY,150,150,0.005,0.005\n")(project / "block")
    _runs("rejected: image_point 0101/LONELY: seen in one image only")
    assert current(project) == ALL
    with h5py.File(project / "run/current/block.h5") as file:
        assert list(file["rejects/id"].asstr()[:]) == ["0101/LONELY"]


@pytest.mark.slow
def test_many_points_seen_once_are_rejected_and_the_run_goes_on(project: Path) -> None:
    more = "".join(f"0101,LONELY{k},{150 + k},150,0.005,0.005\n" for k in range(30))
    lines(POINTS, lambda line: line, more=more)(project / "block")
    _runs("rejected: 30 of kind image_point: seen in one image only")
    assert current(project) == ALL


@pytest.mark.slow
def test_an_image_without_points_among_many_is_rejected_and_the_run_goes_on(project: Path) -> None:
    write_pipeline(
        project / "larger", SIMULATE.replace("strips: 2, images_per_strip: 5", "strips: 3, images_per_strip: 7")
    )
    assert aatri("run", "-q", project / "larger" / "pipeline.yaml").exit_code == 0
    shutil.rmtree(project / "block")
    assert aatri("export", "larger/run:block", "tables", "block").exit_code == 0
    without(EXTERIOR)(project / "block")
    lines(POINTS, lambda line: None if line.startswith("0202,") else line)(project / "block")
    write_pipeline(project, TABLES, FLAT)
    _runs("rejected: image 0202: fewer than 3 points and no observed position")
    assert current(project) == ALL


@pytest.mark.slow
def test_an_image_without_points_among_ten_is_left_out(project: Path) -> None:
    without(EXTERIOR)(project / "block")
    lines(POINTS, lambda line: None if line.startswith("0103,") else line)(project / "block")
    write_pipeline(project, TABLES, FLAT)
    _runs("rejected: image 0103: fewer than 3 points and no observed position")
    assert current(project) == ALL


@pytest.mark.slow
def test_an_image_without_points_but_with_a_position_is_left_out_and_named(project: Path) -> None:
    lines(POINTS, lambda line: None if line.startswith("0103,") else line)(project / "block")
    _runs(
        "no model 0102-0103: 0 common points",
        "strips: strip 1, 0103: image alone",
        "bundle: left out, no start or too few points (1 of 10 images): 0103",
    )
    assert current(project) == ALL


@pytest.mark.slow
def test_a_strip_that_nothing_joins_is_set_aside_and_named(project: Path) -> None:
    lines(POINTS, _no_link)(project / "block")
    _runs("component 2 (strip 2): not determined")
    assert current(project) == ALL


@pytest.mark.slow
def test_two_control_points_are_refused_before_anything_is_computed_from_them(project: Path) -> None:
    without(EXTERIOR)(project / "block")
    _keep_control(2)(project / "block")
    write_pipeline(project, TABLES, FLAT)
    _fails(4, "neither three control points nor anything else that says how it lies", "2 control points")


@pytest.mark.slow
def test_collinear_control_names_the_rotation_about_the_line(project: Path) -> None:
    _on_a_line(project / "block")
    write_pipeline(project, TABLES, FLAT)
    _fails(4, "not determined: rotation about the line through point")
    assert current(project) == BEFORE_ABSOLUTE


def test_a_block_without_any_datum_is_refused_as_soon_as_it_has_been_read(project: Path) -> None:
    without(EXTERIOR)(project / "block")
    _keep_control(0)(project / "block")
    _fails(4, "stage absolute: the block has neither control nor observed positions", "exterior.csv")
    assert current(project) == {"block"}


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ("bundle", "stages wait for each other: strip_block -> bundle -> strip_block"),
        ("strip_block", "stages wait for each other: strip_block -> strip_block"),
        ("models", "strip_block.initial wants a Solution, but models gives Models"),
        ("absolut", "no stage 'absolut' - did you mean 'absolute'?"),
    ],
)
def test_wrong_wiring_is_found_before_anything_runs(project: Path, initial: str, message: str) -> None:
    path = write_pipeline(project, TABLES, STAGES.replace("initial: absolute", f"initial: {initial}"))
    line = 1 + path.read_text()[: path.read_text().index("models, initial: ")].count("\n")
    _fails(2, f"pipeline.yaml:{line}:", message)
    assert not (project / "run").exists()


@pytest.mark.slow
def test_after_a_failure_nothing_below_it_is_current(project: Path) -> None:
    assert aatri("run", "-q").exit_code == 0
    assert current(project) == ALL
    _on_a_line(project / "block")
    _fails(4, "not determined")
    assert current(project) == BEFORE_ABSOLUTE
    assert (project / "run" / "report.html").is_file()
    assert (project / "run" / "failed" / "absolute" / "error.json").is_file()
    status = aatri("status")
    assert re.search(r"bundle .*perhaps stale", status.stdout)
