"""A run that adjusts two blocks, each with what the other says of it: the page is of the last Solution's own block."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.report.page import _counts
from aatri.report.problems import problems
from aatri.report.view.run_view import RunView, StageView
from tests.made_solutions import made_block


def _stage(name: str, kind: str, metrics: dict[str, Any] | None = None, **inputs: str) -> StageView:
    return StageView(name, "", kind, inputs, {"metrics": metrics or {}}, None, ())


def _run(tmp_path: Path) -> RunView:
    stages = (
        _stage("west", "Block", {"images": 3}),
        _stage("east", "Block", {"images": 4}),
        _stage("of_west", "Information", block="west", other="east"),
        _stage("of_east", "Information", block="east", information="of_west", other="west"),
        _stage("all_east", "Solution", {"images": 4}, block="east", information="of_west"),
        _stage("all_west", "Solution", {"images": 3}, block="west", information="of_east"),
        _stage("check_west", "Evaluation", {"check_points": 5}, block="west", solution="all_west"),
        _stage("check_east", "Evaluation", {"check_points": 6}, block="east", solution="all_east"),
    )
    blocks = {"west": made_block(columns=3), "east": made_block(columns=4)}
    return RunView(tmp_path, {}, stages, kept=dict(blocks))


def test_the_block_is_that_of_the_last_solution_and_not_one_whose_information_it_took(tmp_path: Path) -> None:
    run = _run(tmp_path)
    assert list(run.readable(Block)) == ["west"]
    assert run.last(Block) is run.kept["west"]
    assert _counts(run)["images"] == "3"


def test_the_evaluation_is_that_of_the_last_solution(tmp_path: Path) -> None:
    assert _run(tmp_path).evaluated()[-1].name == "check_west"
    assert _run(tmp_path).of_kind(Evaluation)[-1].name == "check_east"


def test_warnings_of_image_points_are_among_the_problems(tmp_path: Path) -> None:
    """That all marks of a camera are wrong stood beside the stage alone: no later one sees fiducial marks."""

    def warned(stage: StageView, name: str) -> StageView:
        return replace(stage, name=name, record={"metrics": {}, "warnings": [f"{name} are odd"]})

    stages = [warned(stage, stage.name) for stage in _run(tmp_path).stages]
    interior = replace(warned(stages[0], "marks"), kind="ImagePoints")
    run = RunView(tmp_path, {}, (interior, *stages))
    texts = [problem.text.lower() for problem in problems(run, [])]
    assert "marks are odd" in texts
    assert "all_east are odd" not in texts
