"""Quality gates on a small simulated block, as a user meets them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.acceptance.small_block import aatri, current


@pytest.fixture
def gated(project: Path) -> Path:
    path = project / "pipeline.yaml"
    path.write_text("gates: {accuracy: {check_rmse_z_m: {max: 50}}}\n" + path.read_text())
    return project


@pytest.mark.slow
def test_a_run_passes_fails_and_is_judged_by_what_was_asked_for(gated: Path) -> None:
    done = aatri("run", "-q")
    assert done.exit_code == 0, done.stderr
    keys = {path.name: path.read_text() for path in (gated / "run" / "current").glob("*.json")}
    value = json.loads(aatri("metrics", "run", "--json").stdout)["accuracy"]["check_rmse_z_m"]
    failed = aatri("run", "-q", "--set", "gates.accuracy.check_rmse_z_m.max=1e-6")
    assert failed.exit_code == 6
    assert f"accuracy.check_rmse_z_m: {value:.6g}, wanted at most 1e-06" in failed.stderr
    assert keys == {path.name: path.read_text() for path in (gated / "run" / "current").glob("*.json")}
    assert "run: gate_failed" in aatri("status", "run").stdout
    assert "<caption>Gates</caption>" in (gated / "run" / "report.html").read_text()
    wrong = aatri("run", "-q", "--set", "gates.accuracy.chek_rmse_z_m.max=1")
    assert wrong.exit_code == 2
    assert "did you mean 'check_rmse_z_m'" in wrong.stderr
    assert aatri("run", "-q", "--until", "bundle", "--set", "gates.accuracy.check_rmse_z_m.max=1e-6").exit_code == 0
    assert "accuracy" in current(gated)


@pytest.mark.slow
def test_without_check_points_a_gate_on_the_check_fails(gated: Path) -> None:
    path = gated / "block" / "ground_points.csv"
    header, *rows = path.read_text().splitlines()
    kept = [row for row in rows if not row.startswith("CHK")]
    assert len(kept) < len(rows)
    path.write_text("\n".join([header, *kept, ""]))
    done = aatri("run", "-q")
    assert done.exit_code == 6, done.stderr
    assert "pipeline.yaml:1:36: accuracy.check_rmse_z_m: no value, wanted at most 50" in done.stderr
