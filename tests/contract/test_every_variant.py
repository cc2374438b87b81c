"""The same checks on every variant of every role that the registry finds."""

from __future__ import annotations

import atexit
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.builder import block_of
from aatri.artifacts.image_points import ImagePoints
from aatri.pipeline.methods.registry import find_stages
from aatri.stages.block.photos import PhotosOptions, photos
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.connected import connected
from aatri.stages.tie_points.sift import sift
from aatri.stages.tie_points.thin import ThinOptions, thin
from aatri.tables.digest import content_digest
from aatri.tables.schema import Artifact
from aatri.testing.check import check_stage
from aatri.testing.example_inputs import EXAMPLES, example_block, example_folder, example_inputs
from tests.contract.digests import digests_of_all
from tests.contract.made_files import colmap_database, colmap_model, model_file, pair_files, two_parts
from tests.made_photographs import flown
from tests.made_scans import scan, scanned_block
from tests.stages.chain import run_chain, simulated

VARIANTS = sorted(find_stages().variants)
MADE_FILES = {
    "block/tables": example_folder,
    "block/colmap": colmap_model,
    "block/pairs": pair_files,
    "block/models": model_file,
    "block/photos": lambda folder: flown(folder, strips=1, per_strip=2).folder,
}
REAL_FILES = {
    "block/bal": {"path": "bal/problem-49-7776-pre.txt"},
    "block/dbat": {
        "path": "dbat/sxb/f-op0-no-orient-pmexport.txt",
        "control": "dbat/sxb/ctrlpts-fixed.txt",
    },
    "block/gama": {"path": "geodetic/3D/Ghilani_GNSS_Baselines.gkf"},
    "block/wucaps": {"path": "rc30_2x3/Data/bundle_ajustment"},
}
"""What variants read that have options without default: made-up files, or option -> path under the real data."""


SIX_IMAGES = {"strips": 2, "images_per_strip": 3, "cross_strips": 0}


def needed_options(name: str, folder: Path, request: pytest.FixtureRequest) -> dict[str, Any] | None:
    """Options for variants in which some have no default: files to read."""
    if name in MADE_FILES:
        return {"path": MADE_FILES[name](folder / "made")}
    if name == "tie_points/database":
        return {"path": colmap_database(photographed_block(), folder / "made.db")}
    if name == "block/merged":
        return {"blocks": tuple(str(path) for path in two_parts(folder / "made"))}
    if name == "information/reduced":
        return {"keep": {"images": ["*"]}}
    if name == "block/part":
        return {"path": example_folder(folder / "made"), "images": ["*"]}
    if name == "block/combined":
        return {"sources": (str(colmap_model(folder / "made")),)}
    if name in REAL_FILES:
        shared_data: Path = request.getfixturevalue("shared_data")
        return {option: shared_data / path for option, path in REAL_FILES[name].items()}
    return None


def needed_inputs(name: str) -> dict[str, Artifact] | None:
    """Inputs of a variant that cannot take those of the usual chain."""
    if name == "model_adjustment/given_models":
        return {"block": models_of_a_block()}
    if name == "bundle_adjustment/alternating":  # it converges slowly, the more so the larger the block
        made = run_chain(simulated(preset="rc30", flight=SIX_IMAGES, ties={"new_points": 40}))
        return {"block": made.block, "image_points": made.refined, "initial": made.strip_block}
    if name == "tie_points/lsm":
        return oriented_photographs()
    if name in ("tie_points/sift", "tie_points/colmap", "tie_points/database"):
        return {"block": photographed_block()}
    if name.startswith("fiducial_marks/"):
        return {"block": block_of_scans()}
    if name == "accuracy/plotter":  # it wants residuals of image points
        return example_inputs("epochs", find_stages().role("epochs"))
    if name != "strip_formation/connected":
        return None
    registry = find_stages()
    given = example_inputs("strip_formation", registry.role("strip_formation"))
    points = example_inputs("relative_orientation", registry.role("relative_orientation"))["image_points"]
    block = given["block"]
    assert isinstance(block, Block)
    assert isinstance(points, ImagePoints)
    return {**given, "models": connected(block, points)}


@cache
def photographed_block(strips: int = 1) -> Block:
    """Two photographs of a strip, without image points."""
    folder = Path(tempfile.mkdtemp(prefix="aatri-photographs-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return photos(options=PhotosOptions(path=flown(folder, strips, 2).folder))


@cache
def oriented_photographs() -> dict[str, Artifact]:
    """Four photographs with some tie points, oriented."""
    block = thin(sift(photographed_block(2)), options=ThinOptions(cells=4))
    oriented = graph(block, calibrated(block), rng=np.random.default_rng(1))
    return {"block": block, "solution": oriented}


@cache
def block_of_scans() -> Block:
    """One scan with crosses of the size that the stage looks for unless it is told another."""
    from PIL import Image

    folder = Path(tempfile.mkdtemp(prefix="aatri-scans-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    Image.fromarray((scan(0.5, 3.0)[0] * 255).astype(np.uint8)).save(folder / "a.tif")
    return scanned_block(folder / "a.tif")


def models_of_a_block() -> Block:
    """Two models that are shifted against each other, over five control points."""
    X = np.array([[x, y, (x * y) % 7] for x in (0.0, 100.0, 200.0, 300.0) for y in (0.0, 90.0, 180.0)])
    ids = [f"P{k}" for k in range(len(X))]
    of = [(m, k) for m, first in enumerate((0, 3)) for k in range(first, first + 9)]
    in_models = {
        "model": [f"m{m}" for m, _ in of],
        "point": [ids[k] for _, k in of],
        "xyz": np.array([0.01 * X[k] + m for m, k in of]),
        "sigma": 1e-4,
    }
    control = {"point": ids[::2], "xyz_m": X[::2], "sigma_m": 0.01, "role": CONTROL}
    return block_of(name="models", model_coordinates=in_models, ground_points=control)


SECONDS = {
    "absolute_orientation/similarity",
    "block/photos",
    "bundle_adjustment/alternating",
    "bundle_adjustment/bundle",
    "bundle_adjustment/intersection",
    "design/criteria",
    "fiducial_marks/template",
    "information/reduced",
    "initial_orientation/graph",
    "model_adjustment/independent_models",
    "relative_orientation/connected",
    "tie_points/colmap",
    "tie_points/lsm",
    "tie_points/sift",
}
"""Variants whose contract takes more than one."""


@pytest.mark.parametrize("name", [pytest.param(v, marks=[pytest.mark.slow] if v in SECONDS else []) for v in VARIANTS])
def test_every_variant_keeps_its_contract(name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if name == "tie_points/colmap":
        pytest.importorskip("pycolmap")
    report = check_stage(name, options=needed_options(name, tmp_path, request), inputs=needed_inputs(name))
    assert {"contract", "method", "options", "runs", "kind", "file", "repeatable"} <= {c.name for c in report.checks}


def shuffle_rows_and_columns(folder: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for path in sorted(folder.glob("*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = list(csv.reader(file))
        columns = rng.permutation(len(head))
        mixed = [head, *(rows[k] for k in rng.permutation(len(rows)))]
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([row[k] for k in columns] for row in mixed)


@pytest.mark.parametrize("example", EXAMPLES)
@pytest.mark.parametrize("seed", range(5))
def test_the_order_of_rows_and_columns_of_a_block_folder_changes_no_digest(
    tmp_path: Path, example: str, seed: int
) -> None:
    read = find_stages().card("block/tables")
    assert read.options is not None
    folder = example_folder(tmp_path / "block", example)
    shuffle_rows_and_columns(folder, seed)
    block = read.function(options=read.options(path=folder))
    assert isinstance(block, Block)
    truth = frozenset({"true_images", "true_points", "gross_errors"})
    assert content_digest(block) == content_digest(example_block(example), without=truth)
    assert block.image_points.line.tolist() != example_block(example).image_points.line.tolist()


# -- results do not depend on the process --


@pytest.mark.slow
def test_a_process_with_another_hash_seed_gives_the_same_digests() -> None:
    environment = {**os.environ, "PYTHONHASHSEED": "12345"}
    command = [sys.executable, "-m", "tests.contract.digests"]
    other = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    here = digests_of_all()
    assert len(here) > 5
    assert json.loads(other.stdout) == here
