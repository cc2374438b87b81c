"""`aatri new --from` writes a pipeline that runs as it is, or says what is missing; `aatri formats` lists formats."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from aatri.artifacts.block import Exterior, StripIds
from aatri.cli.main import app
from aatri.cli.new_from import counted
from aatri.formats.navigation.photo_folder import read_photographs
from aatri.formats.registry.settings import settings_of
from aatri.formats.registry.sources import read_all
from aatri.formats.tables.writer import write_block
from aatri.pipeline.methods.catalogue import Catalogue
from aatri.pipeline.plan.graph import wire
from aatri.pipeline.spec.pipeline_file import load_spec
from aatri.progress import SILENT
from tests.campaigns.fuzz_seeds import READERS
from tests.formats.opensfm.made_project import write_project
from tests.made_photographs import HEIGHT, WIDTH, exif_of
from tests.stages.chain import simulated


def invoked(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_a_project_of_opensfm_becomes_a_pipeline_that_runs(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm" / "opensfm")
    (tmp_path / "odm" / "notes.txt").write_text("nothing\n")
    result = invoked("new", tmp_path / "mine", "--from", tmp_path / "odm")
    assert result.exit_code == 0, result.stderr
    assert "reconstruction.json: OpenSfM reconstruction" in result.stderr
    assert "6 images" in result.stderr
    assert "missing: control or observed positions, check points" in result.stderr
    path = tmp_path / "mine" / "pipeline.yaml"
    spec = load_spec(path)
    wire(spec, Catalogue())
    assert "../odm/opensfm/tracks.csv" in path.read_text()
    assert "datum: minimal" in path.read_text()
    assert "self_calibration" in path.read_text(), "OpenSfM has estimated the camera from the same image points"
    assert "variance_components" not in path.read_text(), "image points alone have no other kind to be weighed against"
    assert folder.is_dir()


def test_several_files_may_follow_one_from(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm" / "opensfm")
    result = invoked("new", tmp_path / "mine", "--from", folder / "tracks.csv", folder / "reconstruction.json")
    assert result.exit_code == 0, result.stderr
    text = (tmp_path / "mine" / "pipeline.yaml").read_text()
    assert "tracks.csv" in text
    assert "reconstruction.json" in text
    assert "aatri export RUN:block tables FOLDER" in text


def test_photographs_without_attitudes_have_positions(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image").new("L", (WIDTH, HEIGHT))
    for k in range(2):
        image.save(tmp_path / f"{k}.jpg", exif=exif_of(np.array([10.0 * k, 0.0, 100.0]), k))
    assert counted(read_photographs(tmp_path)) == ["1 camera", "2 images", "2 positions", "frame EPSG:4979"]


@pytest.mark.slow
def test_the_pipeline_runs_as_it_is(tmp_path: Path) -> None:
    write_project(tmp_path / "odm")
    assert invoked("new", tmp_path / "mine", "--from", tmp_path / "odm").exit_code == 0
    result = invoked("run", tmp_path / "mine" / "pipeline.yaml")
    assert result.exit_code == 0, result.stderr


def test_names_that_match_by_rule_alone_and_those_that_match_nothing_are_told(tmp_path: Path) -> None:
    """IMG_0.JPG is img_0 of the list; img_99 is of another flight; a file of notes is of no format."""
    folder = write_project(tmp_path / "odm")
    (folder / "notes.txt").write_text("nothing\n")
    rows = "".join(f"img_{name} {k} {k} 100\n" for k, name in enumerate((0, 1, 2, 99)))
    (tmp_path / "positions.txt").write_text("image X Y Z\n" + rows)
    result = invoked("new", tmp_path / "mine", "--from", folder, "--from", tmp_path / "positions.txt")
    assert "3 image names matched by without folder and extension, whatever the case" in result.stderr
    assert "1 of its 4 images are not in the block, and are left out: img_99" in result.stderr
    assert f"of no known format, not read: {folder / 'notes.txt'}" in result.stderr


def test_sources_may_be_named_one_by_one(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm")
    more = ["--from", folder / "reconstruction.json", "--from", folder / "tracks.csv"]
    assert invoked("new", tmp_path / "mine", *more).exit_code == 0
    assert "2 sources" in (tmp_path / "mine" / "pipeline.yaml").read_text()


def test_a_distortion_of_micmac_is_exact_and_needs_no_leave(tmp_path: Path, interchange: Path) -> None:
    source = interchange / "micmac" / "Ori-MMV1"
    result = invoked("new", tmp_path / "mine", "--from", source)
    assert "7 images, but no image points" in result.stderr
    assert "lens-misfit" not in result.stderr


@pytest.mark.slow
def test_a_distortion_without_like_is_taken_by_leave_only(tmp_path: Path, interchange: Path) -> None:
    """A camera of MicMac whose distortion is centred 100 px beside the principal point, as none of aatri is."""
    name = "AutoCal_Foc-60000_Cam-NIKON_D810.xml"
    text = (interchange / "micmac" / "Ori-MMV1" / name).read_text()
    source = tmp_path / name
    source.write_text(text.replace("<CDist>3715.", "<CDist>3815."))
    refused = invoked("new", tmp_path / "mine", "--from", source)
    assert "undistorted images" in refused.stderr
    leave = re.search(r"`--lens-misfit (\S+)`", refused.stderr)[1]
    assert float(re.search(r"differs by up to (\S+) px", refused.stderr)[1]) <= float(leave)
    allowed = invoked("new", tmp_path / "mine", "--from", source, "--lens-misfit", leave)
    assert "no source has images or image points" in allowed.stderr


def test_what_is_missing_is_named_and_nothing_is_written(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm")
    result = invoked("new", tmp_path / "mine", "--from", folder / "reconstruction.json")
    assert result.exit_code == 3
    assert "6 images, but no image points" in result.stderr
    result = invoked("new", tmp_path / "mine", "--from", folder / "tracks.csv")
    assert result.exit_code == 3
    assert "none gives a camera" in result.stderr
    assert not (tmp_path / "mine").exists()


@pytest.mark.parametrize(("name", "file"), [("gama", "n.gkf"), ("bal", "p.txt"), ("tables", "")])
def test_formats_with_a_stage_of_their_own_are_read_by_it(tmp_path: Path, name: str, file: str) -> None:
    source = tmp_path / "source"
    source.mkdir()
    READERS[name].write(source)
    if name == "tables":  # a lever arm to which no position refers is refused
        yaml = source / "block.yaml"
        yaml.write_text(re.sub(r"    lever_arm: .*\n", "", yaml.read_text()))
    result = invoked("new", tmp_path / "mine", "--from", source / file)
    assert result.exit_code == 0, result.stderr
    path = tmp_path / "mine" / "pipeline.yaml"
    assert f"use: block/{name}" in path.read_text()
    assert "use: accuracy/evaluation" in path.read_text()
    assert ("m and mm of the results are units of the model" in result.stderr) == (name == "bal")
    wire(load_spec(path), Catalogue())


def test_what_a_run_would_refuse_and_warn_of_is_shown_and_the_pipeline_is_there_to_be_edited(tmp_path: Path) -> None:
    source, path = tmp_path / "source", tmp_path / "mine" / "pipeline.yaml"
    source.mkdir()
    READERS["tables"].write(source)  # with a lever arm to which no position refers
    result = invoked("new", path.parent, "--from", source)
    assert result.exit_code == 3
    assert path.is_file()
    text = result.stderr
    refused = f"{path} is written; as it stands, a run of it is refused for what follows: edit the file, or remove it"
    parts = [
        "warning: block: rejected: geodetic distance 3 3: from a station",
        refused,
        "error: camera uav: lever arms",
    ]
    places = [text.find(part) for part in parts]
    assert 0 <= places[0] < places[1] < places[2]


def test_formats_are_listed_and_described() -> None:
    listed = json.loads(invoked("formats", "--json").stdout)
    assert {"tables", "opensfm", "odm_gcp", "colmap"} <= {f["name"] for f in listed}
    result = invoked("formats", "odm_gcp")
    (lacking,) = (line for line in result.stdout.splitlines() if line.startswith("does not carry"))
    assert "standard deviations" in lacking
    assert "image points" not in lacking
    assert invoked("formats", "odm_gpc").exit_code == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "has"),
    [
        (
            {
                "preset": "uav",
                "flight": {"strips": 2, "images_per_strip": 4},
                "ties": {"per_position": 0, "random_per_image": 60.0},
            },
            ("calibrated", "scale_transfer"),
        ),
        (
            {
                "preset": "rc30",
                "flight": {"strips": 2, "images_per_strip": 4, "cross_strips": 0},
                "ties": {"new_points": 400},
            },
            ("affine", "scale_transfer"),
        ),
        (
            {"preset": "oblique", "flight": {"strips": 2, "images_per_strip": 3}, "ties": {"new_points": 900}},
            ("calibrated", "graph"),
        ),
    ],
)
def test_a_block_of_strips_or_without_runs_by_the_pipeline_that_fits_it(tmp_path: Path, changes, has) -> None:
    block = simulated(2, **changes)
    if "graph" in has:  # nobody says how it was flown, nor where from
        images = replace(block.images, strip=np.full(len(block.images), -1, np.int32))
        block = replace(block, images=images, strips=StripIds.empty(), exterior=Exterior.empty())
    write_block(block, tmp_path / "block")
    assert invoked("new", tmp_path / "mine", "--from", tmp_path / "block").exit_code == 0
    text = (tmp_path / "mine" / "pipeline.yaml").read_text()
    assert all(name in text for name in has)
    result = invoked("run", tmp_path / "mine" / "pipeline.yaml", "--quiet")
    assert result.exit_code == 0, result.stderr
    assert "Check points agree" in result.stdout


GEOID = "23FD1305_alt_test.OPK:geoid=fr_ign_RAF20.tif"


def of_borea(interchange: Path, tmp_path: Path, *settings: str) -> Result:
    folder = interchange / "borea"
    said = [word for setting in settings for word in ("--set", setting)]
    return invoked("new", tmp_path / "mine", "--from", folder, "--without", "terrain_test0.mes", *said)


@pytest.mark.slow
def test_altitudes_above_a_grid_in_the_folder_run_with_what_is_set_on_the_command_line(
    tmp_path: Path, interchange: Path
) -> None:
    """Of three control points each is predicted by the others and the positions: 300 px would be 70 m."""
    settings = ["crs=EPSG:2154", GEOID, "23FD1305_alt_test.OPK:use=observed", "position_sigma=[0.1,0.1,0.1]"]
    settings += ["attitude_sigma_deg=0.005", "control_sigma=[0.1,0.1,0.1]"]
    assert of_borea(interchange, tmp_path, *settings).exit_code == 0
    result = invoked("run", tmp_path / "mine" / "pipeline.yaml", "--quiet")
    assert result.exit_code == 0, result.stderr
    assert "as the standard deviations say" in result.stdout


def test_a_grid_of_a_geoid_beside_the_files_is_told_with_the_setting_that_takes_it(
    tmp_path: Path, interchange: Path
) -> None:
    result = of_borea(interchange, tmp_path)
    assert "fr_ign_RAF20.tif: grid of a geoid, not used" in result.stderr
    assert f"--set crs=EPSG:... --set {GEOID}" in result.stderr
    assert "23FD1305_alt_test.OPK:use=observed --set position_sigma=" in result.stderr
    assert "--set position_sigma=[0.1,0.1,0.1] --set attitude_sigma_deg=0.01" in result.stderr


def test_a_height_system_of_one_source_joins_the_coordinate_system_of_all(tmp_path: Path, interchange: Path) -> None:
    result = of_borea(interchange, tmp_path, "crs=EPSG:2154", "23FD1305_alt_test.OPK:vertical=EPSG:5720")
    assert result.exit_code == 3
    assert "fr_ign_RAF20" in result.stderr, "the grid that PROJ lacks is named"


def test_a_coordinate_system_of_all_sources_leaves_alone_those_that_name_one(tmp_path: Path) -> None:
    (tmp_path / "gcp_list.txt").write_text("EPSG:32632\n500000 5400000 100 10 20 IMG_0.JPG A\n")
    (tmp_path / "positions.txt").write_text("image X Y Z\nIMG_0.JPG 500010 5400000 200\n")
    paths = [tmp_path / "gcp_list.txt", tmp_path / "positions.txt"]
    sources, parts = read_all(paths, settings_of(["crs=EPSG:32633"]), SILENT)
    crs = {
        s.path.name: (p.frame.crs, [setting.key for setting in s.settings]) for s, p in zip(sources, parts) if p.frame
    }
    assert crs == {"gcp_list.txt": ("EPSG:32632", []), "positions.txt": ("EPSG:32633", ["crs"])}


def test_a_list_without_a_header_is_read_by_the_columns_that_are_set(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm")
    (folder / "p.txt").write_text("".join(f"IMG_{k}.JPG;{k};{k};100\n" for k in range(3)))
    result = invoked("new", tmp_path / "mine", "--from", folder, "--set", "p.txt:columns=image X Y Z")
    assert result.exit_code == 0, result.stderr
    assert 'p.txt", format: table, columns: "image X Y Z"' in (tmp_path / "mine" / "pipeline.yaml").read_text()


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        (["crs"], "not KEY=VALUE"),
        (["image_sigma_pix=1"], "did you mean 'image_sigma_px'"),
        (["image_sigma_px=-1"], "greater than 0"),
        (["nothing.txt:crs=EPSG:25832"], "no source is nothing.txt"),
        (["tracks.csv:image_sigma_px=1"], "no option 'image_sigma_px' of a source"),
        (["use=observed"], "use is of one source, and there are"),
        (["maps=up"], "ground_from_image"),
    ],
)
def test_a_setting_that_is_none_is_refused(tmp_path: Path, settings: list[str], what: str) -> None:
    folder = write_project(tmp_path / "odm")
    words = [word for setting in settings for word in ("--set", setting)]
    result = invoked("new", tmp_path / "mine", "--from", folder / "reconstruction.json", "--from", folder, *words)
    assert result.exit_code == 2
    assert what in " ".join(result.stderr.split())


def test_a_missing_demo_is_no_internal_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aatri.cli.new_block.__file__", str(tmp_path / "aatri" / "cli" / "new_block.py"))
    result = invoked("new", tmp_path / "mine", "--block", "tables")
    assert result.exit_code == 8
    assert "install aatri again" in result.stderr
