"""What a result offers and no stage of the pipeline uses is refused before anything is made of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aatri.cli.main import app
from tests.made_up_stages import write_pipeline
from tests.pipeline.offering_stages import offering_registry

HEAD = "run: out\nseed: 1\n"
GIVEN = "  a: {use: source/given}\n"
UNUSED = GIVEN + "  s: {use: sum/careful, from: {numbers: a}, with: {observed: false}}\n"


@pytest.fixture(autouse=True)
def _made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", offering_registry)


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def run(stages: str, *arguments: str, ignore: str = "") -> Result:
    write_pipeline(Path(), stages, HEAD + (f"ignore: {ignore}\n" if ignore else ""))
    return aatri("run", "-q", *arguments)


def made() -> set[str]:
    return {path.stem for path in Path("out/current").glob("*.h5")}


def test_what_is_used_passes() -> None:
    result = run(GIVEN + "  s: {use: sum/careful, from: {numbers: a}}\n")
    assert result.exit_code == 0
    assert "not used" not in result.output


@pytest.mark.slow
def test_what_no_stage_uses_is_an_error_with_place_name_and_remedy_before_the_next_stage() -> None:
    result = run(UNUSED)
    assert result.exit_code == 3
    assert "list.csv:2: 3 numbers (list.csv: x): not used by any stage of this pipeline" in result.stderr
    assert "ignore: [list.observed]" in result.stderr
    assert made() == {"a"}


def test_what_a_stage_needs_and_does_not_get_is_an_error_before_the_next_stage() -> None:
    needy = "  s: {use: sum/needy, from: {numbers: a}}\n"
    for _ in range(2):  # read from the cache of methods the second time
        result = run(GIVEN + needy)
        assert result.exit_code == 4
        assert "pipeline.yaml, stage s: neither groups nor words, without which the stage cannot work" in result.stderr
        assert "give groups" in result.stderr
        assert made() == {"a"}
    assert run(GIVEN + needy.replace("}}", "}, with: {observed: false}}")).exit_code == 0
    assert run("  a: {use: source/given, with: {count: 2}}\n" + needy).exit_code == 0


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", ["[list.observed]", "[list]"])
def test_ignored_it_is_a_warning_on_the_terminal_and_in_the_report_and_changes_no_key(name: str) -> None:
    assert run(GIVEN + "  s: {use: sum/careful, from: {numbers: a}}\n").exit_code == 0
    key = json.loads(Path("out/current/a.json").read_text())["key"]
    result = run(UNUSED, ignore=name)
    assert result.exit_code == 0
    assert "warning: a: list.csv:2: 3 numbers" in result.stderr
    assert "3 numbers (list.csv: x)" in Path("out/report.html").read_text()
    assert json.loads(Path("out/current/a.json").read_text())["key"] == key
    assert made() == {"a", "s"}


def test_a_pipeline_whose_results_are_all_there_is_refused_as_well_once_nothing_is_ignored() -> None:
    assert run(UNUSED, ignore="[list]").exit_code == 0
    assert run(UNUSED).exit_code == 3
    result = run(UNUSED, ignore="[list]")
    assert result.exit_code == 0
    assert "warning: a:" in result.stderr
    again = aatri("run", "-q")  # nothing to do, and still told
    assert "warning: a:" in again.stderr


def test_one_stage_that_uses_it_is_enough_whatever_is_selected() -> None:
    stages = UNUSED + "  t: {use: sum/careful, from: {numbers: a}}\n"
    assert run(stages, "--until", "s").exit_code == 0


def test_a_grouping_is_a_warning_and_what_bears_on_no_result_of_the_pipeline_is_left_alone() -> None:
    stages = "  a: {use: source/given, with: {count: 3}}\n  s: {use: sum/careful, from: {numbers: a}}\n"
    result = run(stages)
    assert result.exit_code == 0
    assert "2 groups (list.csv: group): not used" in result.stderr
    assert "1 word" not in result.stderr


def test_a_result_that_no_stage_takes_is_left_alone() -> None:
    assert run(GIVEN).exit_code == 0


@pytest.mark.slow
def test_where_a_stage_does_not_say_what_it_uses_it_is_a_warning_that_names_the_stage() -> None:
    result = run(GIVEN + "  s: {use: sum/mute, from: {numbers: a}}\n")
    assert result.exit_code == 0
    assert "no stage says that it uses it (sum/mute states nothing)" in result.stderr


def test_a_stage_that_uses_what_no_port_offers_is_refused_with_the_name_that_was_meant() -> None:
    result = run(GIVEN + "  s: {use: sum/misspelt, from: {numbers: a}}\n")
    assert result.exit_code == 9
    assert "did you mean 'list.observed'?" in result.stderr


def test_a_single_stage_is_refused_too() -> None:
    write_pipeline(Path(), UNUSED, HEAD)
    first = aatri("exec", "pipeline.yaml", "a")
    assert first.exit_code == 3
    assert "not used by any stage" in first.stderr
    second = aatri("exec", "pipeline.yaml", "s")
    assert second.exit_code == 3
    assert made() == {"a"}


def test_status_and_dry_run_are_not_concerned() -> None:
    write_pipeline(Path(), UNUSED, HEAD)
    assert aatri("run", "--dry-run").exit_code == 0
    assert aatri("status").exit_code == 0


def test_keeping_going_makes_nothing_of_it_but_all_the_rest() -> None:
    stages = UNUSED + "  b: {use: source/given}\n  t: {use: sum/mute, from: {numbers: b}}\n"
    result = run(stages, "--keep-going")
    assert result.exit_code == 3
    assert made() == {"a", "b", "t"}


def test_ignore_must_be_a_list_of_names() -> None:
    assert "ignore is 'list'" in run(UNUSED, ignore="list").stderr


def test_the_card_of_a_stage_says_what_it_uses() -> None:
    assert "uses     list: observed" in aatri("stages", "sum/careful").stdout
    assert "uses     not stated" in aatri("stages", "sum/mute").stdout
    assert json.loads(aatri("stages", "sum/careful", "--json").stdout)["uses"] == ["list.observed"]
