"""`import aatri`: run, open, stages, artifacts, data frames, and what they look like."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

import aatri
from aatri.errors import ArtifactError, InputError, SpecError
from aatri.pipeline.store import run_folder as store
from tests.made_solutions import made_block, made_solution
from tests.made_up_stages import made_up_registry, write_pipeline
from tests.pipeline.made_runs import bare_record

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


@pytest.fixture
def opened(tmp_path: Path) -> aatri.api.Run:  # type: ignore[name-defined]
    stages = [
        {"stage": "block", "use": "block/tables", "from": {}, "kind": "Block"},
        {"stage": "bundle", "use": "bundle_adjustment/bundle", "from": {"block": "block"}, "kind": "Solution"},
        {"stage": "later", "use": "accuracy/evaluation", "from": {}, "kind": "Evaluation"},
    ]
    run = tmp_path / "run"
    store.begin(
        run,
        {"pipeline": "p.yaml", "seed": 1, "started": "2026-01-01T00:00:00+00:00", "stages": stages, "status": "done"},
    )
    block = made_block()
    for name, artifact in (("block", block), ("bundle", made_solution(block))):
        store.commit(run, name, "0123456789ab", artifact, bare_record() | {"metrics": artifact.metrics()})
    return aatri.open(run)


def test_importing_aatri_loads_nothing() -> None:
    code = "import sys, aatri; print([m for m in ('numpy', 'h5py', 'typer') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
    assert {"run", "open"} <= set(dir(aatri))
    with pytest.raises(AttributeError):
        aatri.nothing  # noqa: B018


def test_a_run_shows_its_stages_metrics_and_typed_artifacts(opened: aatri.api.Run) -> None:  # type: ignore[name-defined]
    assert list(opened) == ["block", "bundle", "later"]
    bundle = opened["bundle"]
    assert bundle.metrics["images"] == bundle.artifact.images.oriented.sum()
    assert repr(bundle.artifact.points) == "<SolvedPoints: 20 rows of id, xyz_m, covariance_m2, rays>"
    assert "20 points" in repr(bundle.artifact)
    assert "bundle: bundle_adjustment/bundle, Solution" in repr(opened)
    assert "later: accuracy/evaluation, not run" in repr(opened)
    with pytest.raises(SpecError, match="did you mean 'bundle'"):
        opened["bundel"]
    with pytest.raises(ArtifactError, match="has no result"):
        opened["later"].metrics  # noqa: B018


def test_tables_become_data_frames_of_what_is_installed(opened: aatri.api.Run, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[name-defined]
    made = ModuleType("pandas")
    made.DataFrame = lambda columns: SimpleNamespace(columns=columns, attrs={})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", made)
    frame = opened["bundle"].to_dataframe("points")
    assert frame.columns["point"][0] == "p00"
    assert frame.attrs["units"]["X_m"] == "m"
    monkeypatch.setitem(sys.modules, "pandas", None)
    made.DataFrame = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "polars", made)
    assert opened["bundle"].to_dataframe("points")["point"][0] == "p00"
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(InputError, match="neither pandas nor polars"):
        opened["bundle"].to_dataframe("points")


def test_a_pipeline_is_run_and_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)
    write_pipeline(tmp_path, LINES)
    run = aatri.run("pipeline.yaml", set=["a.count=4"])
    assert list(run) == ["a", "s"]
    assert run["s"].record is not None
    assert list(aatri.open("pipeline.yaml")) == ["a", "s"]
