"""`aatri new` of a block folder with another source: a network that it shows, control without standard deviations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from aatri.artifacts.block import Block
from aatri.cli.main import app
from aatri.errors import InputError
from aatri.formats.parts.format import Reading
from aatri.formats.registry.own_stages import TABLES
from aatri.formats.tables.writer import write_block
from aatri.pipeline.spec.pipeline_file import load_spec
from aatri.progress import SILENT
from aatri.stages.block.combined import CombinedOptions, combined
from aatri.stages.block.merged import MergedOptions, merged
from tests.formats.merging.test_merged import ray_block

GAMA = """<gama-local><network axes-xy="en" angles="left-handed"><points-observations>
<point id="{}" x="0" y="0" z="0" fix="xyz" /><point id="{}" x="9" y="0" z="0" adj="xyz" />
<obs><s-distance from="{}" to="{}" val="9.1" stdev="5" /></obs></points-observations></network></gama-local>
"""


def _in_height_axes(block: Block) -> Block:
    return replace(block, frames=replace(block.frames, axes=np.array(["east,north,up"])))


def _files(folder: Path, names: tuple[str, str]) -> tuple[Path, Path]:
    """A block folder of two images of the points A to E, one of control, and a network of two points."""
    rays = {f"{image}/{point}": {"xy": (k, -k)} for image in "12" for k, point in enumerate("ABCDE")}
    write_block(
        _in_height_axes(ray_block(rays, {"E": {"xyz_m": (5, 5, 1)}}, image_coordinates="photo")), folder / "photos"
    )
    (folder / "network.gkf").write_text(GAMA.format(*names, *names))
    return folder / "photos", folder / "network.gkf"


def _declare(photos: Path) -> None:
    """Give the block folder a coordinate system."""
    spec = photos / "block.yaml"
    text = spec.read_text().replace('"crs": "local"', '"crs": "EPSG:25832"')
    spec.write_text(text.replace("earth_curvature: ignore\n", ""))


def test_images_that_show_the_points_of_a_network_are_merged_with_it(tmp_path: Path) -> None:
    photos, network = _files(tmp_path, ("A", "D"))
    result = CliRunner().invoke(app, ["new", str(tmp_path / "both"), "--from", str(photos), "--from", str(network)])
    text = (tmp_path / "both" / "pipeline.yaml").read_text()
    assert 'use: block/merged, with: {blocks: ["../photos", "../network.gkf"]}' in text, result.stderr
    assert "interior_orientation/calibrated" in text
    assert load_spec(tmp_path / "both" / "pipeline.yaml").stages


def test_a_network_is_merged_from_its_file(tmp_path: Path) -> None:
    photos, network = _files(tmp_path, ("A", "D"))
    block = merged(options=MergedOptions.model_validate({"blocks": [photos, network]}))
    assert isinstance(block, Block)
    assert len(block.geodetic) == 1
    assert (block.geodetic.start[0], block.geodetic.end[0]) == ("A", "D")


def test_a_network_of_other_points_is_refused_with_what_merges(tmp_path: Path) -> None:
    photos, network = _files(tmp_path, ("far", "away"))
    result = CliRunner().invoke(app, ["new", str(tmp_path / "both"), "--from", str(photos), "--from", str(network)])
    assert result.exit_code == 3
    assert "block/merged" in result.stderr


def _new(tmp_path: Path, sources: tuple[Path, ...], *settings: str) -> Result:
    options = [part for text in settings for part in ("--set", text)]
    from_ = [part for path in sources for part in ("--from", str(path))]
    return CliRunner().invoke(app, ["new", str(tmp_path / "both"), *from_, *options])


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("setting", ["crs=EPSG:25832", "network.gkf:crs=EPSG:25832"])
def test_the_coordinate_system_of_a_network_is_written_into_the_pipeline(tmp_path: Path, setting: str) -> None:
    sources = _files(tmp_path, ("A", "D"))
    _declare(sources[0])
    done = _new(tmp_path, sources, setting)
    text = (tmp_path / "both" / "pipeline.yaml").read_text()
    assert '{blocks: ["../photos", {path: "../network.gkf", crs: "EPSG:25832"}]}' in text, done.stderr
    options = load_spec(tmp_path / "both" / "pipeline.yaml").stages["block"].options
    blocks = {"blocks": [sources[0], options["blocks"][1] | {"path": sources[1]}]}
    assert merged(options=MergedOptions.model_validate(blocks)).frames.crs[0] == "EPSG:25832"


@pytest.mark.parametrize(
    "setting", ["nonsense=3", "image_sigma_px=2", "network.gkf:use=observed", "photos:crs=EPSG:3857"]
)
def test_what_is_not_merged_with_is_refused_by_name(tmp_path: Path, setting: str) -> None:
    done = _new(tmp_path, _files(tmp_path, ("A", "D")), setting)
    assert done.exit_code == 2
    assert f"--set {setting}" in done.stderr


@pytest.mark.parametrize(
    ("images", "what"), [(False, "a network beside a list without images"), (True, "aatri new IMAGES")]
)
def test_a_list_beside_a_network_is_called_a_list(tmp_path: Path, images: bool, what: str) -> None:
    photos, network = _files(tmp_path, ("A", "D"))
    (tmp_path / "control.csv").write_text("point,X,Y,Z\nA,0,0,0\nB,1,0,0\nC,2,3,0\n")
    done = _new(tmp_path, (network, tmp_path / "control.csv", *[photos] * images))
    assert done.exit_code == 3
    assert what in done.stderr
    assert "several sources of images" not in done.stderr


@pytest.mark.parametrize(
    ("name", "what"), [("absent.gkf", "does not exist"), ("list.csv", "is neither a block folder")]
)
def test_what_is_no_block_is_not_said_to_name_its_coordinate_system(tmp_path: Path, name: str, what: str) -> None:
    photos, _ = _files(tmp_path, ("A", "D"))
    (tmp_path / "list.csv").write_text("point,X,Y,Z\nA,0,0,0\nB,1,0,0\nC,2,3,0\n")
    options = {"blocks": [photos, {"path": tmp_path / name, "crs": "EPSG:25832"}]}
    with pytest.raises(InputError, match=what):
        merged(options=MergedOptions.model_validate(options))
    with pytest.raises(InputError, match="says its coordinate system itself"):
        merged(options=MergedOptions.model_validate({"blocks": [{"path": photos, "crs": "EPSG:25832"}, photos]}))


def test_the_coordinate_system_of_a_network_is_told_beside_its_path(tmp_path: Path) -> None:
    photos, network = _files(tmp_path, ("A", "D"))
    _declare(photos)
    with pytest.raises(InputError, match="in the frame EPSG:25832") as raised:
        merged(options=MergedOptions.model_validate({"blocks": [photos, network]}))
    assert "beside the path" in raised.value.remedy
    options = {"blocks": [photos, {"path": network, "crs": "EPSG:25832"}]}
    assert len(merged(options=MergedOptions.model_validate(options)).geodetic) == 1


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("axes", "stated"), [("east, north, up", "0.01, 0.02, 0.03"), ("up, north, east", "0.03, 0.02, 0.01")]
)
def test_standard_deviations_of_block_yaml_are_those_of_control_of_another_source(
    tmp_path: Path, axes: str, stated: str
) -> None:
    photos, _ = _files(tmp_path, ("A", "D"))
    (photos / "ground_points.csv").unlink()
    spec = photos / "block.yaml"
    text = spec.read_text().replace('"east", "north", "up"', axes)
    spec.write_text(f"{text}sigma: {{control: [{stated}], position: [{stated}]}}\n")
    (tmp_path / "control.csv").write_text("point,X,Y,Z\nA,0,0,0\nB,1,0,0\nC,2,3,0\n")
    sources = [str(photos), str(tmp_path / "control.csv")]
    block = combined(options=CombinedOptions.model_validate({"sources": sources}))
    np.testing.assert_allclose(block.ground_points.covariance_m2, [np.diag([1e-4, 4e-4, 9e-4])] * 3)
    assert TABLES.read is not None
    assert TABLES.read(photos, Reading(), SILENT).not_stated["position_sigma"] == (0.01, 0.02, 0.03)
    block = combined(options=CombinedOptions.model_validate({"sources": sources, "control_sigma": [0.0, 0.0, 0.0]}))
    np.testing.assert_array_equal(block.ground_points.covariance_m2, np.zeros((3, 3, 3)))
    done = CliRunner().invoke(app, ["new", str(tmp_path / "both"), "--from", *sources])
    assert f"[0.01, 0.02, 0.03] m is taken (as {spec} says" in done.stderr
    assert "control_sigma: [0.01, 0.02, 0.03]" in (tmp_path / "both" / "pipeline.yaml").read_text()
