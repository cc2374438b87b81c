"""`aatri new` of a block folder with another source: a network that it shows, control without standard deviations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aatri.artifacts.block import Block
from aatri.cli.main import app
from aatri.errors import InputError
from aatri.formats.tables.writer import write_block
from aatri.pipeline.spec.pipeline_file import load_spec
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


def test_the_coordinate_system_of_a_network_is_told_beside_its_path(tmp_path: Path) -> None:
    photos, network = _files(tmp_path, ("A", "D"))
    spec = photos / "block.yaml"
    spec.write_text(
        spec.read_text().replace('"crs": "local"', '"crs": "EPSG:25832"').replace("earth_curvature: ignore\n", "")
    )
    with pytest.raises(InputError, match="in the frame EPSG:25832") as raised:
        merged(options=MergedOptions.model_validate({"blocks": [photos, network]}))
    assert "beside the path" in raised.value.remedy
    options = {"blocks": [photos, {"path": network, "crs": "EPSG:25832"}]}
    assert len(merged(options=MergedOptions.model_validate(options)).geodetic) == 1


def test_standard_deviations_of_block_yaml_are_those_of_control_of_another_source(tmp_path: Path) -> None:
    photos, _ = _files(tmp_path, ("A", "D"))
    (photos / "ground_points.csv").unlink()
    spec = photos / "block.yaml"
    spec.write_text(spec.read_text() + "sigma: {control: [0.02, 0.02, 0.03]}\n")
    (tmp_path / "control.csv").write_text("point,X,Y,Z\nA,0,0,0\nB,1,0,0\nC,2,3,0\n")
    sources = [str(photos), str(tmp_path / "control.csv")]
    block = combined(options=CombinedOptions.model_validate({"sources": sources}))
    np.testing.assert_allclose(block.ground_points.covariance_m2, [np.diag([4e-4, 4e-4, 9e-4])] * 3)
    block = combined(options=CombinedOptions.model_validate({"sources": sources, "control_sigma": [0.0, 0.0, 0.0]}))
    np.testing.assert_array_equal(block.ground_points.covariance_m2, np.zeros((3, 3, 3)))
    CliRunner().invoke(app, ["new", str(tmp_path / "both"), "--from", *sources])
    assert "control_sigma: [0.02, 0.02, 0.03]" in (tmp_path / "both" / "pipeline.yaml").read_text()
