"""Shell completion knows the stages and variants of the pipeline, the runs, and the stages of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from aatri.cli.arguments.completion import complete_in_bash
from aatri.cli.main import VERBS, app
from aatri.errors import Faults, SpecError
from aatri.pipeline.methods.catalogue import Catalogue
from aatri.pipeline.methods.registry import Registry
from aatri.pipeline.spec.pipeline_file import load_spec

PIPELINE = """\
run: runs/first
stages:
  block: {use: block/simulate, with: {preset: rc30}}
  bundle: {use: bundle_adjustment/bundle, from: {block}}
variants:
  robust: {bundle: {with: {reliability: true}}}
"""


@pytest.fixture
def _project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    (tmp_path / "runs" / "first").mkdir(parents=True)
    stages = [{"stage": "block", "use": "block/simulate", "from": {}, "kind": "Block"}]
    overview = {"stages": stages, "status": "done", "pipeline": "p", "request": {}}
    (tmp_path / "runs" / "first" / "run.json").write_text(json.dumps(overview))


def _completed(line: str) -> list[str]:
    """What bash would offer at the end of the line."""
    words = line.split(" ")
    environment = {"_AATRI_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    done = CliRunner().invoke(app, [], env=environment, prog_name="aatri")
    return done.output.split()


@pytest.mark.usefixtures("_project")
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("aatri run --until b", ["block", "bundle"]),
        ("aatri run --only bu", ["bundle"]),
        ("aatri run pipeline.yaml --from bl", ["block"]),
        ("aatri run --variant ", ["robust"]),
        ("aatri status ", ["pipeline.yaml", "runs/first"]),
        ("aatri metrics ru", ["runs/first"]),
        ("aatri show runs/first:", ["runs/first:block"]),
        ("aatri export :bu", [":bundle"]),
        ("aatri export runs/first ta", ["tables", "table"]),
        ("aatri new --block u", ["unordered"]),
        ("aatri run --set bu", ["bundle."]),
        ("aatri run --set bundle.relia", ["bundle.reliability="]),
        ("aatri run --use bundle=bundle_adjustment/re", ["bundle=bundle_adjustment/resection"]),
        ("aatri accept a", ["all"]),
        ("aatri stages epochs/s", ["epochs/surveys"]),
        ("aatri formats metash", ["metashape"]),
        ("aatri show :bundle susp", ["suspects"]),
        ("aatri convert x --to tables --angle g", ["gon"]),
        ("aatri new --plugin epo", ["epochs/"]),
        ("aatri schema --out pipe", ["pipeline.yaml"]),
    ],
)
def test_completion_knows_stages_variants_and_runs(line: str, offered: list[str]) -> None:
    assert _completed(line) == offered


@pytest.mark.usefixtures("_project")
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("aatri show runs/first : bl", ["block"]),
        ("aatri show runs/first :", ["block"]),
        ("aatri export : bl", ["block"]),
        ("aatri run --set bundle.relia", ["bundle.reliability="]),
        ("aatri run --use bundle = bundle_adjustment/re", ["bundle_adjustment/resection"]),
        ("aatri run --use = bundle = bundle_adjustment/re", ["bundle_adjustment/resection"]),
    ],
)
def test_bash_which_parts_words_at_colons_and_equals_signs_gets_the_last_part(
    words: str, offered: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_AATRI_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words.replace(" ", "\n"))
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    complete_in_bash(lambda: app(prog_name="aatri"))
    assert capsys.readouterr().out.split() == offered


@pytest.mark.usefixtures("_project")
def test_options_are_completed_without_importing_a_stage_that_was_completed_or_planned_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _completed("aatri run --set bundle.relia") == ["bundle.reliability="]
    with monkeypatch.context() as patch:
        patch.setattr(Registry, "card", lambda *_: pytest.fail("a stage was imported"))
        assert _completed("aatri run --set bundle.relia") == ["bundle.reliability="]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    spec, catalogue = load_spec(Path("pipeline.yaml")), Catalogue()
    assert catalogue.prepare(spec, spec.stages["block"], Faults(SpecError)) is not None
    catalogue.save()
    monkeypatch.setattr(Registry, "card", lambda *_: pytest.fail("a stage was imported"))
    assert _completed("aatri run --set block.pres") == ["block.preset="]


def test_pictures_and_questions_are_completed_from_the_list_of_the_report_each_once(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps({"stages": [], "status": "done", "pipeline": "p", "request": {}}))
    pictures = {"plan": ["plan"], "ties": ["overlap", "ties"], "tests": [], "residuals": ["tilt"]}
    (run / "report.json").write_text(json.dumps({"pictures": pictures}))
    assert _completed(f"aatri plot {run} t") == ["ties", "tilt"]
    assert _completed(f"aatri plot {run} ") == ["all", "plan", "ties", "residuals", "overlap", "tilt"]


@pytest.mark.usefixtures("_project")
def test_a_pipeline_that_cannot_be_read_completes_nothing(tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text("stages: [")
    assert _completed("aatri run --until b") == []
    assert _completed("aatri show nowhere:") == []


FREE = {("accept", "message"), ("convert", "crs")}
"""Arguments that may be any text."""


def test_every_argument_is_completed() -> None:
    group: Any = typer.main.get_command(app)
    for verb in VERBS:
        for parameter in group.get_command(None, verb).params:
            kind = parameter.type_descriptor.annotation
            if kind not in (bool, int, float) and (verb, parameter.name) not in FREE:
                assert parameter._custom_shell_complete is not None, (verb, parameter.name)
