"""Reading a block needs no compiler and no method: a mistake in a file is told before anything is compiled."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import aatri

ROOT = Path(aatri.__file__).parents[1]

IMPORT = """
import importlib, json, pathlib, sys
for path in sorted(pathlib.Path("stages/block").glob("[!_]*.py")):
    importlib.import_module(f"aatri.stages.block.{path.stem}")
print(json.dumps(sorted(sys.modules)))
"""

METHODS = ("bundle", "bodies", "graph", "relative", "resection", "strips", "network", "interior", "refinement")


def test_block_stages_import_neither_numba_nor_a_method() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    done = subprocess.run(
        [sys.executable, "-c", IMPORT], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    modules = json.loads(done.stdout)
    assert "aatri.checks.as_read.screening" in modules
    assert "numba" not in modules
    methods = tuple(f"aatri.orientation.{name}" for name in METHODS)
    assert [m for m in modules if m.startswith((*methods, "aatri.adjustment.stepping.adjust"))] == []


@pytest.mark.slow
def test_a_mistake_in_a_block_is_told_while_kernels_are_compiled(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "block.yaml").write_text("aatri_block: 1\nname: none\n")
    (tmp_path / "pipeline.yaml").write_text(
        "run: out\nstages:\n"
        "  block: {use: block/tables, with: {path: data}}\n"
        "  interior: {use: interior_orientation/calibrated, from: {block}}\n"
        "  bundle: {use: bundle_adjustment/bundle, from: {block, image_points: interior}}\n"
    )
    path = os.pathsep.join([str(ROOT), *filter(None, sys.path)])
    caches = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    done = subprocess.run(
        [sys.executable, "-c", "from aatri.cli.main import main; main()", "run"],
        cwd=tmp_path,
        env={**os.environ, **caches, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert "data/block.yaml:1:1: frames is missing" in done.stderr
    assert "compiling the inner loops" in done.stderr
    assert len(list((tmp_path / "numba").rglob("*.nbi"))) < 90  # most were not waited for
