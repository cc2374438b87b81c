"""The chain from simulated film to evaluated block, through the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import h5py
import pytest

from tests.acceptance.small_block import SIMULATE, STAGES, TABLES, aatri, current, write_pipeline

pytestmark = pytest.mark.slow

DEMO = Path(__file__).parents[2] / "pipeline.yaml"


def _metrics(run: Path) -> dict[str, dict[str, Any]]:
    result = aatri("metrics", run, "--json")
    assert result.exit_code == 0, result.stderr
    metrics: dict[str, dict[str, Any]] = json.loads(result.stdout)
    return metrics


def _digests(folder: Path) -> dict[str, str]:
    digests = {}
    for path in sorted((folder / "run" / "current").glob("*.h5")):
        with h5py.File(path) as file:
            digests[path.stem] = file.attrs["content_digest"].decode()
    return digests


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    run = tmp_path_factory.mktemp("demo")
    result = aatri("run", DEMO, "-q", "--into", run)
    assert result.exit_code == 0, result.stderr
    assert (run / "report.html").is_file()
    return _metrics(run)


def test_the_demo_is_the_block_of_the_notes(demo: dict[str, dict[str, Any]]) -> None:
    block, accuracy = demo["block"], demo["accuracy"]
    assert (block["images"], block["strips"], block["control_points"], block["check_points"]) == (255, 11, 72, 36)
    assert accuracy["truth_points"] == 3632


def test_the_bundle_of_the_demo_is_as_sharp_as_its_standard_deviations_say(demo: dict[str, dict[str, Any]]) -> None:
    accuracy = demo["accuracy"]
    assert 0.98 <= demo["bundle"]["sigma0"] <= 1.02
    for axis, limit_m in (("x", 0.013), ("y", 0.013), ("z", 0.030)):
        truth, theory = accuracy[f"truth_rmse_{axis}_m"], accuracy[f"theory_rmse_{axis}_m"]
        assert truth <= limit_m
        assert truth == pytest.approx(theory, rel=0.07)


@pytest.mark.parametrize("axis", "xyz")
def test_each_adjustment_of_the_demo_is_better_than_the_one_before(demo: dict[str, dict[str, Any]], axis: str) -> None:
    stages = ("accuracy_absolute", "accuracy_strip_block", "accuracy")
    absolute, strip_block, bundle = (demo[stage][f"truth_rmse_{axis}_m"] for stage in stages)
    assert bundle < strip_block < absolute


def test_an_exported_block_gives_the_same_digests_as_the_simulated_one(tmp_path: Path) -> None:
    simulated, read = tmp_path / "simulated", tmp_path / "read"
    assert aatri("run", "-q", write_pipeline(simulated, SIMULATE)).exit_code == 0
    assert aatri("export", f"{simulated / 'run'}:block", "tables", read / "block").exit_code == 0
    assert aatri("run", "-q", write_pipeline(read, TABLES)).exit_code == 0
    expected, found = _digests(simulated), _digests(read)
    assert set(found) == set(expected) == {"block", *re.findall(r"^  (\w+):", STAGES, re.MULTILINE)}
    for stage in ("interior", "refined", "models", "strips", "absolute", "strip_block", "bundle"):
        assert found[stage] == expected[stage], stage
    assert found["block"] != expected["block"], "the truth and the places in the files belong to the content"


def test_the_same_pipeline_gives_the_same_digests_in_another_folder(tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert aatri("run", "-q", write_pipeline(tmp_path / name, SIMULATE)).exit_code == 0
    assert _digests(tmp_path / "a") == _digests(tmp_path / "b")
    assert current(tmp_path / "a") == set(_digests(tmp_path / "a"))
