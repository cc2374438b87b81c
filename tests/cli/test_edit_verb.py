"""`aatri edit`: ten mistakes, proposals, edits, and the block adjusted again as if they had not been made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aatri.api import open_run
from aatri.artifacts.block import CONTROL, Block
from aatri.cli.main import app
from aatri.formats.tables.writer import write_block
from tests.stages.chain import simulated

PIPELINE = """
run: out
seed: 1
stages:
  block:    {use: block/tables, with: {path: block}}
  interior: {use: interior_orientation/calibrated, from: {block}}
  start:    {use: initial_orientation/graph, from: {block, image_points: interior}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: interior, initial: start}}
"""


def _aatri(*arguments: str) -> str:
    done = CliRunner().invoke(app, list(arguments))
    assert done.exit_code == 0, done.output
    return done.output


def _mistakes(block: Block) -> tuple[Block, Block]:
    """The block with six wrong image points, an exchanged pair, control and a position wrong; and without these."""
    rng, m = np.random.default_rng(8), block.image_points
    rays = np.bincount(m.point, minlength=len(block.points))[m.point]
    rows = rng.choice(np.flatnonzero(rays >= 5), 6, replace=False)
    xy, active = m.xy.copy(), m.active.copy()
    xy[rows] += rng.choice([-1, 1], (6, 2)) * rng.uniform(17.0, 33.0, (6, 2))  # px of 2.4 um
    active[rows] = False
    pair = np.flatnonzero((m.image == 5) & (rays >= 5) & active)[[0, -1]]
    xy[pair] = xy[pair[::-1]]
    given, flown = block.ground_points, block.exterior
    control = np.flatnonzero((given.role == CONTROL).all(axis=1))[2]
    ground, position = given.xyz_m.copy(), flown.position_m.copy()
    ground[control] += [0.4, -0.3, 0.6]
    position[7] += [1.0, 1.5, -2.0]
    role, unknown = given.role.copy(), flown.position_m.copy()
    role[control], unknown[7] = 0, np.nan
    wrong = replace(
        block,
        image_points=replace(m, xy=xy),
        ground_points=replace(given, xyz_m=ground),
        exterior=replace(flown, position_m=position),
    )
    without = replace(
        block,
        image_points=replace(m, active=active),
        ground_points=replace(given, role=role),
        exterior=replace(flown, position_m=unknown),
    )
    return wrong, without


@pytest.mark.slow
def test_a_block_with_ten_mistakes_edited_is_the_clean_one_without_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    flight = {"strips": 3, "images_per_strip": 6}
    clean = simulated(3, preset="uav", flight=flight, known={"layout": [], "full": 9}, gnss={"observed": True})
    wrong, without = _mistakes(clean)
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    write_block(without, tmp_path / "block")
    _aatri("run", "--into", "without", "--quiet")
    write_block(wrong, tmp_path / "block")
    measured = (tmp_path / "block/image_points.csv").read_bytes()
    _aatri("run", "--quiet")
    shown = _aatri("edit")
    assert "nothing is written" in shown
    assert not (tmp_path / "block/edits.yaml").exists()
    assert shown.count("switch_off image_point") == 6
    assert shown.count("exchange image_point") == 1
    assert shown.count("switch_off control point") == shown.count("switch_off position image") == 1
    _aatri("edit", "--apply", "2-3")
    assert "0 edits written to block/edits.yaml, after 2 that it had" in _aatri("edit", "--apply", "2-3")
    _aatri("run", "--quiet")
    assert "7 edits written to block/edits.yaml, after 2 that it had" in _aatri("edit", "--apply", "all")
    _aatri("run", "--quiet")
    assert "bundle proposes nothing" in _aatri("edit")
    assert (tmp_path / "block/image_points.csv").read_bytes() == measured
    edited, true = (open_run(name)["bundle"].artifact for name in ("out", "without"))
    np.testing.assert_allclose(edited.points.xyz_m, true.points.xyz_m, rtol=0, atol=1e-7)
    assert edited.redundancy == true.redundancy
    (tmp_path / "block/edits.yaml").unlink()
    _aatri("run", "--quiet")
    assert "switch_off control point" in _aatri("edit")


@pytest.mark.slow
def test_a_number_that_is_no_proposal_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flight = {"strips": 2, "images_per_strip": 4}
    clean = simulated(3, preset="uav", flight=flight, known={"full": 4}, ties={"random_per_image": 60.0})
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    write_block(clean, tmp_path / "block")
    assert "aatri run" in CliRunner().invoke(app, ["edit"]).output  # it has not been run
    _aatri("run", "--quiet")
    for text in ("7", "1-", "x", "0", "3-2"):
        done = CliRunner().invoke(app, ["edit", "--apply", text])
        assert done.exit_code == 2, done.output
        assert "is no proposal" in done.output
