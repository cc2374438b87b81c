"""Frames, positions and attitudes in the report."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyproj import Proj

import aatri
from aatri.report.sections.block import frame_tables
from aatri.report.sections.observations import of_images, of_the_network
from aatri.report.sections.solution import position_pictures
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.made_solutions import made_block
from tests.stages.geodetic_blocks import made


def test_the_frame_of_the_adjustment_is_told_with_scale_and_convergence_of_the_map() -> None:
    block = made(1, 1000.0)
    declared, adjustment = frame_tables(block)
    assert declared.rows[0][:3] == (block.frames.id[0], "east,north,up", block.frames.crs[0])
    told = dict(adjustment.rows)
    assert told["adjusted in"] == "a tangent frame of the ellipsoid"
    east, north, _ = (float(x) for x in told["origin"].split(","))
    projection = Proj(str(block.frames.crs[0]))
    factors = projection.get_factors(*projection(east, north, inverse=True))
    assert abs(float(told["scale of the map there"]) - np.sqrt(factors.areal_scale)) < 2e-7
    convergence = [row[1] for row in adjustment.rows if row[0].startswith("convergence")]
    assert abs(abs(float(convergence[0])) - abs(factors.meridian_convergence)) < 2e-5


def test_a_local_block_has_no_frame_but_its_own() -> None:
    assert len(frame_tables(made_block())) == 1


def test_positions_and_attitudes_are_listed_image_by_image_with_their_tests() -> None:
    block = made(1, 1000.0, imu={"observed": True, "rotation": "roll-pitch-heading"}, survey={"distances": 5})
    options = BundleOptions.model_validate({"reliability": True, "blunders": "none"})
    solution = bundle(block, calibrated(block), options=options)
    listed = of_images(solution)
    assert listed is not None
    n = len(block.images)
    assert sorted(row[0] for row in listed.rows) == ["attitude"] * n + ["position"] * n
    assert {row[1] for row in listed.rows} == set(block.images.id.tolist())
    first = dict(zip(listed.heads, listed.rows[0]))
    assert [len(first[head].split(", ")) for head in ("residual", "redundancy", "w")] == [3, 3, 3]
    between = of_the_network(solution)
    assert between is not None
    assert {row[0] for row in between.rows} == {"distance"}
    plan, height = position_pictures(solution)
    assert plan.title == "Residuals of observed positions in plan"
    assert plan.caption.startswith(f"Adjusted minus observed, at {n} images")
    assert height.title == "Residuals of observed positions in height"


# The report is written where a run fails, too: nothing is compiled before the error is told.


ROOT = Path(aatri.__file__).parents[1]


@pytest.mark.slow
def test_the_page_imports_no_numba() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    code = "import sys, aatri.report.page; print('numba' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"
