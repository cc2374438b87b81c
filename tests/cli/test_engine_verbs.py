from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aatri.cli.main import ELSEWHERE, VERBS, app
from tests.made_up_stages import made_up_registry, write_pipeline

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"
HEAD = "run: out\nseed: 1\nvariants: {far: {s: {with: {offset: 9.0}}}}\n"


@pytest.fixture(autouse=True)
def _made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    write_pipeline(tmp_path, LINES, HEAD)
    assert aatri("run").exit_code == 0
    return tmp_path


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def test_every_verb_of_the_help_is_there() -> None:
    for verb in VERBS:
        module = importlib.import_module(f"aatri.cli.{verb}")
        assert callable(getattr(module, "exec_" if verb == "exec" else verb))
        assert aatri(verb, "--help").exit_code == 0
    wrong = aatri("stauts")
    assert wrong.exit_code == 2
    assert "did you mean 'status'" in wrong.output
    for verb, where in ELSEWHERE.items():
        assert verb not in VERBS
        assert where in " ".join(aatri(verb).output.split())
        assert any(f"aatri {known}" in where for known in VERBS)


@pytest.mark.slow
def test_status_and_a_run_with_nothing_to_do_import_nothing_heavy(tmp_path: Path) -> None:
    options = (
        "{preset: uav, flight: {strips: 2, images_per_strip: 4, cross_strips: 0}, known: {full: 8}, "
        "ties: {new_points: 80}}"
    )
    refined = "from: {block, image_points: interior, initial: start}, with: {self_calibration: {set: brown_conrady}}"
    path = write_pipeline(
        tmp_path,
        f"  block: {{use: block/simulate, with: {options}}}\n"
        "  interior: {use: interior_orientation/calibrated, from: {block}}\n"
        "  start: {use: initial_orientation/graph, from: {block, image_points: interior}}\n"
        f"  bundle: {{use: bundle_adjustment/bundle, {refined}}}\n",
    )
    code = (
        "import sys; from typer.testing import CliRunner; from aatri.cli.main import app\n"
        f"r = CliRunner().invoke(app, [sys.argv[1], {str(path)!r}]); assert r.exit_code == 0, r.output\n"
        "print(r.output, [m for m in ('numpy', 'numba', 'scipy', 'h5py', 'aatri.plugin') if m in sys.modules])"
    )
    _, status, again = (
        subprocess.run([sys.executable, "-c", code, verb], capture_output=True, text=True, check=True).stdout
        for verb in ("run", "status", "run")
    )
    assert "nothing to do: 4 stages up to date" in again
    assert "bundle: parameters" in again  # from the report's first page
    assert status.endswith(" []\n")
    assert again.endswith(" []\n")


@pytest.mark.slow
def test_dry_run_status_and_dag_tell_one_plan(project: Path) -> None:
    write_pipeline(project, LINES.replace("source/fixed}", "source/fixed, with: {count: 5}}"), HEAD)
    dry = json.loads(aatri("run", "--dry-run", "--json").stdout)["stages"]
    assert [(s["stage"], s["decision"]) for s in dry] == [("a", "run"), ("s", "maybe")]
    assert dry[0]["reasons"][0]["text"] == "options count: 3 -> 5"
    for verb in (("status", "--json"), ("dag", "--json")):
        told = json.loads(aatri(*verb).stdout)
        stages = told["stages"] if isinstance(told, dict) else told
        assert [(s["stage"], s["decision"], s["reasons"]) for s in stages] == [
            (s["stage"], s["decision"], s["reasons"]) for s in dry
        ]
    assert "1 of 2 stages" not in aatri("run", "-n").stdout
    assert "perhaps other a" in aatri("run", "-n").stdout
    assert 'a -> s [label="numbers"]' in aatri("dag", "--dot").stdout
    assert json.loads(aatri("status", "out", "--json").stdout)["stages"][0]["decision"] == "run"


def test_a_failure_tells_how_to_go_on(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["run", "--use", "s=sum/stubborn", "--into", "my runs/x"]
    monkeypatch.setattr(sys, "argv", ["aatri", *arguments])
    result = aatri(*arguments)
    assert result.exit_code == 5
    assert "to go on: aatri run --use s=sum/stubborn --into 'my runs/x'\n" in result.stderr
    wrong = aatri("run", "--set", "s.offset=high")
    assert "to go on" not in wrong.stderr  # nothing was begun


@pytest.mark.slow
def test_a_run_with_nothing_to_do_says_so(project: Path) -> None:
    again = aatri("run")
    assert "nothing to do: 2 stages up to date" in again.stderr
    assert "sum/add" in again.stdout
    assert [s["stage"] for s in json.loads(aatri("run", "--json").stdout)["stages"]] == ["a", "s"]
    write_pipeline(project, LINES, "run: part\nseed: 1\n")
    assert aatri("run", "--until", "a").exit_code == 0
    assert "nothing to do: 1 stage up to date" in aatri("run", "--until", "a").stderr  # what is not asked for may lack


def test_exec_makes_one_stage(tmp_path: Path) -> None:
    write_pipeline(tmp_path, LINES, HEAD)
    assert "s needs a" in aatri("exec", "pipeline.yaml", "s").stderr
    assert aatri("exec", "pipeline.yaml", "a").exit_code == 0
    assert aatri("exec", "out", "s").exit_code == 0
    assert "up to date" in aatri("exec", "out", "s").stderr
    assert "nothing to do" not in aatri("run").stderr  # the report is missing yet


@pytest.mark.slow
def test_exec_takes_up_a_result_that_was_made_before_another(project: Path) -> None:
    """An option changed and changed back: the first result is there yet, and becomes the current one again."""
    first = (project / "out" / "current" / "s.h5").resolve()
    write_pipeline(project, LINES.replace("from: {numbers: a}", "from: {numbers: a}, with: {offset: 4.0}"), HEAD)
    assert aatri("exec", "pipeline.yaml", "s").exit_code == 0
    assert (project / "out" / "current" / "s.h5").resolve() != first
    write_pipeline(project, LINES, HEAD)
    assert "up to date" in aatri("exec", "pipeline.yaml", "s").stderr
    assert (project / "out" / "current" / "s.h5").resolve() == first


def test_slurm_gets_a_job_per_stage(project: Path) -> None:
    assert aatri("export", "pipeline.yaml", "slurm", "jobs.sh").exit_code == 0
    text = (project / "jobs.sh").read_text()
    assert "job_s=$(submit s \"$job_a\" 'aatri exec pipeline.yaml s')" in text
    sbatch = project / "sbatch"
    sbatch.write_text('#!/bin/sh\necho "$@" >> calls.txt; wc -l < calls.txt\n')
    sbatch.chmod(0o755)
    subprocess.run(["bash", "jobs.sh", "--mem=1G"], check=True, env={"PATH": f"{project}:/usr/bin:/bin"})
    calls = (project / "calls.txt").read_text().splitlines()
    assert [f"afterok:{k}" in calls[k] for k in (1, 2)] == [True, False]
    assert "afterok:1:2" in calls[2]
    assert all("--mem=1G" in call for call in calls)
    assert aatri("export", "pipeline.yaml", "slurm", "jobs.sh").exit_code == 2


@pytest.mark.slow
def test_variants_are_run_and_compared(project: Path) -> None:
    assert aatri("run", "--variant", "far").exit_code == 0
    told = json.loads(aatri("compare", "pipeline.yaml", "--variants", "--json").stdout)
    assert told["options"] == {"s.offset": [0.0, 9.0]}
    assert told["metrics"]["s.total"] == [6.0, 15.0]
    found = told["differences"]["far"]
    assert (found["stage"], found["only_last_bits"]) == ("s", False)
    assert found["reasons"][0]["why"] == "options"
    text = aatri("compare", "pipeline.yaml", "--variants").stdout
    parted = "far: parts from out at stage s: options offset: 0.0 -> 9.0 (results differ by more than rounding, largest"
    assert parted in text
    assert "equal to those of out" in aatri("compare", "out", "out").stdout
    assert aatri("compare", "out").exit_code == 2
    assert aatri("compare", "pipeline.yaml", "--variants", "--page", "both.html").stdout == "both.html\n"
    page = Path("both.html").read_text(encoding="utf-8")
    assert page.count("<p>far</p>") == page.count("<p>out</p>") == page.count("<h2>")
    assert "http" not in page.replace("http://www.w3.org", "")
    assert '<th>option</th><th class="n">out</th><th class="n">far</th>' in page
    assert "far: parts from out at stage s: options offset" in page
    assert json.loads(aatri("status", "out/variants/far", "--json").stdout)["stages"][1]["state"] == "done"


def test_a_folder_that_is_neither_run_nor_project_is_told_what_it_is(tmp_path: Path) -> None:
    (tmp_path / "quarry").mkdir()
    for verb, said in (("check", "no pipeline.yaml in it"), ("run", "not the folder of a run")):
        refused = aatri(verb, "quarry")
        assert said in refused.stderr
        assert "give a pipeline file" in refused.stderr
    (tmp_path / "quarry" / "block.yaml").write_text("aatri_block: 1\n")
    for verb in ("check", "run"):
        assert "aatri new FOLDER --from quarry" in aatri(verb, "quarry").stderr


def test_gc_of_what_has_not_been_run_makes_no_folder(tmp_path: Path) -> None:
    write_pipeline(tmp_path, LINES, HEAD)
    assert aatri("gc").exit_code == 0
    assert not (tmp_path / "out").exists()


def test_accept_and_gc(project: Path) -> None:
    assert "a is up to date" in aatri("accept", "a", "-m", "so").stdout
    write_pipeline(project, LINES.replace("source/fixed}", "source/fixed, with: {count: 5}}"), HEAD)
    refused = aatri("accept", "a", "-m", "so")
    assert refused.exit_code == 2
    assert "not only the code has changed but also options" in refused.stderr
    assert aatri("run").exit_code == 0
    assert "2 results could be removed" in aatri("gc", "--keep", "0", "-n").stdout
    assert "2 results removed" in aatri("gc", "--keep", "0").stdout
    assert "nothing to do" in aatri("run").stderr


def test_results_that_are_not_up_to_date_are_said_to_be_so(project: Path) -> None:
    assert "not up to date" not in aatri("metrics").stderr + aatri("show", ":s").stderr
    text = (project / "pipeline.yaml").read_text()
    (project / "pipeline.yaml").write_text(text.replace("{numbers: a}}", "{numbers: a}, with: {offset: 2.0}}"))
    for verb in (("metrics",), ("metrics", "--json"), ("show", ":s"), ("export", "out:s", "tables", "t")):
        assert "warning: not up to date: s (" in aatri(*verb).stderr
    assert "not up to date" not in aatri("show", ":a").stderr


def test_of_stages_that_are_not_shown_nothing_is_said(project: Path) -> None:
    write_pipeline(project, LINES, "run: part\nseed: 1\n")
    assert aatri("run", "--until", "a").exit_code == 0
    assert "up to date" not in aatri("metrics").stderr
    never_run = aatri("show", ":s")
    assert never_run.exit_code == 7
    assert "up to date" not in never_run.stderr


def test_each_result_has_its_reason_and_one_that_may_be_is_named_apart(project: Path) -> None:
    write_pipeline(project, LINES.replace("source/fixed}", "source/fixed, with: {count: 5}}"), HEAD)
    for run in ((), ("pipeline.yaml",), ("out",)):
        told = aatri("metrics", *run).stderr
        of_run = " ".join(("run", *run))
        assert f"warning: not up to date: a (options count: 3 -> 5); `aatri {of_run}` makes it again\n" in told
        assert f"warning: perhaps not up to date: s (perhaps other a); `aatri {of_run}` makes it again\n" in told
    text = (project / "pipeline.yaml").read_text()
    (project / "pipeline.yaml").write_text(text.replace("{numbers: a}}", "{numbers: a}, with: {offset: 2.0}}"))
    told = aatri("metrics").stderr
    assert "not up to date: a (options count: 3 -> 5), s (options offset: 0.0 -> 2.0); `aatri run` makes them" in told


def test_whether_results_are_up_to_date_is_asked_without_compiling(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aatri.cli.arguments.planning.compilation_of", None)
    assert aatri("metrics").exit_code == aatri("show", ":s").exit_code == 0
    monkeypatch.setattr("aatri.pipeline.methods.compile_kernels.missing", lambda _: {"some.kernels.module": project})
    monkeypatch.setattr("aatri.pipeline.methods.kernel_cache.copy_compiled", lambda *_: None)
    monkeypatch.setattr("aatri.pipeline.methods.compile_kernels.without_compiler", lambda do, *what: do(*what))
    assert aatri("metrics").exit_code == 0


def test_where_it_is_not_known_a_line_says_how_to_learn_it(project: Path) -> None:
    assert aatri("run", "--local-plugins", "--into", "own").exit_code == 0
    told = aatri("metrics", "own").stderr
    assert told == "note: made with --local-plugins: `aatri status own --local-plugins` says what is up to date\n"
    (project / "pipeline.yaml").write_text((project / "pipeline.yaml").read_text().replace("sum/add", "sum/ad"))
    told = aatri("metrics", "out").stderr
    assert told.startswith("note: whether this is up to date is not known: ")
    assert "did you mean 'sum/add'? (see `aatri stages sum`" in told
    assert told.count("\n") == 1
