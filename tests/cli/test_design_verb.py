"""`aatri design`: layouts side by side."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app

PIPELINE = """
run: out
seed: 1
stages:
  block:    {use: block/simulate, with: {preset: uav, flight: {strips: 2, images_per_strip: 4}, known: {full: 4},
                                        ties: {random_per_image: 60.0}}}
  interior: {use: interior_orientation/calibrated, from: {block}}
  start:    {use: initial_orientation/graph, from: {block, image_points: interior}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: interior, initial: start},
             with: {point_covariances: ["*"]}}
"""
DESIGN = """  design:   {use: design/criteria, from: {block, solution: bundle},
             with: {sigma_m: [10, 10, 10], distance_m: 100}}
variants:
  more: {block: {with: {known: {full: 8}}}}
"""


def _design(folder: Path, text: str, *more: str):  # type: ignore[no-untyped-def]
    path = folder / "pipeline.yaml"
    path.write_text(text)
    return CliRunner().invoke(app, ["design", str(path), "--into", str(folder / "out"), *more])


@pytest.mark.slow
def test_layouts_stand_side_by_side_and_the_cheapest_that_will_do_is_named(tmp_path: Path) -> None:
    done = _design(tmp_path, PIPELINE + DESIGN, "--quiet")
    assert done.exit_code == 0, done.output
    assert "the criterion is reached by out, more; with the fewest images by out" in done.output
    own = _design(tmp_path, PIPELINE + DESIGN.replace(", distance_m: 100", ""), "--quiet")
    assert "each criterion is that of its own block" in own.output
    assert "with the fewest images" not in own.output
    plain = json.loads(_design(tmp_path, PIPELINE + DESIGN, "--json").stdout)
    first, more = plain["design"]["out"], plain["design"]["more"]
    assert (first["control_points"], more["control_points"]) == (4, 8)
    assert more["median_sigma_z_m"] < first["median_sigma_z_m"]


def test_a_pipeline_without_a_stage_of_role_design_is_refused(tmp_path: Path) -> None:
    done = _design(tmp_path, PIPELINE)
    assert done.exit_code == 2
    assert "no stage of role design" in done.output
