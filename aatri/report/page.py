"""The report: one self-contained HTML page of a run, also of a failed or half-done one; report.json has its first page.

The page carries no script and loads nothing; everything from the run is escaped (autoescape), and a content security
policy forbids the rest. It is a function of the run folder: the same folder gives the same page.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jinja2

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import ArtifactError
from aatri.pipeline.run.overview import command_of
from aatri.pipeline.spec.gates import verdicts_in
from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import on_disk
from aatri.report.drawing.charts import sigma0_chart
from aatri.report.drawing.plan import block_plan
from aatri.report.drawing.svg import Picture
from aatri.report.facts import accuracy_statement, facts
from aatri.report.judgement import judgement
from aatri.report.problems import problems
from aatri.report.sections.evaluation import difference_pictures
from aatri.report.sections.parts import Surroundings
from aatri.report.sections.section import section
from aatri.report.sections.tables import PageTable, accuracy_table
from aatri.report.verdict import external_lights, internal_lights, numbers_of
from aatri.report.view.numbers import number, seconds
from aatri.report.view.run_view import RunView, StageView, view

OURS_AS_JSON = {"made_by": "aatri report"}

OURS, OURS_WITHIN = (b"aatri report</title>", b'"made_by": "aatri report"'), 4000
"""What a page of ours has within its first bytes, as HTML or JSON."""


def write_report(run: Path) -> Path:
    """Write `report.html` and `report.json` into a run folder, from whatever is there.

    Parameters
    ----------
    run : Path
        Folder of a run.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    ArtifactError
        If the folder is no run, or has a page of this name that is another's.
    ResourceError
        If the page cannot be written.
    """
    seen = view(run)
    around = Surroundings(seen.last(Block), seen.last(ImagePoints), seen.last(Solution))
    page = summary(seen, around)
    pages = {"report.html": render(seen, around, page), "report.json": json.dumps(OURS_AS_JSON | page, indent=1) + "\n"}
    for name in pages:
        if inside.kind(run, name) == "file" and not any(o in inside.read(run, name)[:OURS_WITHIN] for o in OURS):
            remedy = "move it, or give the run a folder of its own (`run:` in pipeline.yaml)"
            raise ArtifactError(
                "is not a report of aatri's, and is not overwritten", where=str(run / name), remedy=remedy
            )
    for name, text in pages.items():
        with on_disk(run / name):
            inside.write(text.encode(), run, name)
    return run / "report.html"


def render(run: RunView, around: Surroundings, page: Mapping[str, Any]) -> str:
    """The page as text."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("aatri.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number}
    return environment.get_template("report.html").render(
        name=around.block.name if around.block else run.folder.resolve().name,
        run=run,
        command=command_of(run.overview),
        started=run.overview.get("started", ""),
        total=seconds(sum(float(s.record.get("seconds") or 0.0) for s in run.stages if s.record)),
        page=page,
        failures=[s for s in run.stages if s.failure is not None],
        accuracy=accuracy_table({s.name: s.metrics for s in run.of_kind(Evaluation)}),
        gates=_gates(run),
        pictures=_first_page_pictures(run, around),
        sections=[section(run, stage, around) for stage in run.stages],
        environments=_environments(run.stages),
    )


def summary(run: RunView, around: Surroundings) -> dict[str, Any]:
    """What the first page says, as plain values: report.json has the same."""
    internal, external = internal_lights(run, around.solution), external_lights(run)
    evaluation, evaluations = run.last(Evaluation), run.evaluated()
    return {
        "judgement": judgement(run),
        "accuracy_statement": accuracy_statement(numbers_of(evaluations[-1].metrics)) if evaluations else "",
        "verdict": evaluation.verdict if evaluation else "The accuracy was not evaluated.",
        "facts": facts(around.block, around.solution),
        "problems": [asdict(problem) for problem in problems(run, [*internal, *external])],
        "internal": [asdict(light) for light in internal],
        "external": [asdict(light) for light in external],
        "counts": _counts(run),
        "figures": {stage.name: dict(stage.metrics) for stage in run.stages if stage.metrics},
    }


def _gates(run: RunView) -> PageTable | None:
    """Every quality gate with its bounds and value, passed or failed."""
    rows = [
        (
            v.gate.stage,
            v.gate.metric,
            v.gate.bounds,
            "passed" if v.passed else "failed",
            "no value" if v.value is None else number(v.value),
        )
        for v in verdicts_in(run.overview)
    ]
    return PageTable("Gates", ("stage", "metric", "wanted", "", "value"), rows, 4) if rows else None


def _counts(run: RunView) -> Mapping[str, str]:
    """Counts of the last solution, with what the block has of each."""
    blocks, solutions = run.of_kind(Block), run.of_kind(Solution)
    given: Mapping[str, Any] = blocks[-1].metrics if blocks else {}
    solved: Mapping[str, Any] = solutions[-1].metrics if solutions else {}
    names = (
        "images",
        "points",
        "image_points",
        "strips",
        "control_points",
        "check_points",
        "observations",
        "unknowns",
        "redundancy",
    )
    counts = {}
    for name in names:
        if name in solved and name in given and solved[name] != given[name]:
            counts[name.replace("_", " ")] = f"{number(solved[name])} of {number(given[name])}"
        elif name in solved or name in given:
            counts[name.replace("_", " ")] = number(solved.get(name, given.get(name)))
    return counts


def _first_page_pictures(run: RunView, around: Surroundings) -> list[Picture]:
    pictures = [block_plan(around.block, around.solution) if around.block else None]
    sigma0 = {s.name: float(s.metrics["sigma0"]) for s in run.stages if s.metrics.get("sigma0")}  # type: ignore[arg-type]
    pictures.append(sigma0_chart(sigma0))
    evaluation = run.last(Evaluation)
    if evaluation is not None:
        pictures += difference_pictures(evaluation, around, ("control", "check"))
    return [picture for picture in pictures if picture is not None]


def _environments(stages: tuple[StageView, ...]) -> list[tuple[str, Mapping[str, str]]]:
    """Versions the stages ran with, one entry for all stages that share them."""
    groups: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for stage in stages:
        if stage.record and stage.record.get("environment"):
            groups.setdefault(tuple(sorted(stage.record["environment"].items())), []).append(stage.name)
    return [(", ".join(names), dict(versions)) for versions, names in groups.items()]
