"""The report: one self-contained HTML page of a run, also of a failed or half-done one; report.json has its first page.

The page loads nothing. Its one script stands in it, and a content security policy lets that script run by its digest
and nothing else; everything from the run is escaped (autoescape). It is a function of the run folder: the same folder
gives the same page.
"""

import base64
import contextlib
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import ArtifactError
from aatri.pipeline.run.overview import command_of
from aatri.pipeline.spec.gates import verdicts_in
from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import on_disk
from aatri.report.drawing.picture import COLOURS
from aatri.report.drawing.svg import drawn
from aatri.report.facts import accuracy_statement, facts, was_done
from aatri.report.judgement import judgement
from aatri.report.problems import in_words, problems
from aatri.report.questions import questions
from aatri.report.sections.calibration import parameter_summary
from aatri.report.sections.parts import PageSection, Surroundings
from aatri.report.sections.section import section
from aatri.report.sections.tables import PageTable
from aatri.report.verdict import external_lights, internal_lights, numbers_of
from aatri.report.view.numbers import ANGLES, angles_in, moment, number, seconds
from aatri.report.view.run_view import RunView, StageView, view

OURS_AS_JSON = {"made_by": "aatri report"}

OURS, OURS_WITHIN = (b"aatri report</title>", b'"made_by": "aatri report"', b"(Skia/PDF"), 4000
"""What a page of ours has within its first bytes, as HTML, JSON or PDF."""

OF_SUMMARY = ("plan", "network", "accuracy")
"""Sections whose pictures the summary has."""


def write_report(run: Path, angles: str = "", in_memory: Mapping[str, Any] = {}) -> Path:
    """Write `report.html` and `report.json` into a run folder, from whatever is there.

    Parameters
    ----------
    run : Path
        Folder of a run.
    angles : str
        deg (and arcseconds) or gon (and mgon); empty: those of the report that is there, else deg.
    in_memory : mapping
        Artifacts by content digest, made by this process: of those only the files are checked.

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
    refuse_others(run, ("report.html", "report.json"))
    angles = angles or angles_of(run)
    with angles_in(angles):
        seen, around = seen_in(run, in_memory)
        contents = page_contents(seen, around)
        html = render(seen, around, contents)
    pictures = {answer.name: [picture.name for picture in answer.pictures] for answer in contents.answers}
    text = json.dumps(OURS_AS_JSON | {"angles": angles} | contents.first_page | {"pictures": pictures}, indent=1)
    pages = {"report.html": html, "report.json": f"{text}\n"}
    for name, text in pages.items():
        with on_disk(run / name):
            inside.write(text.encode(), run, name)
    return run / "report.html"


def angles_of(run: Path) -> str:
    """In what the report that is there tells angles."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        angles = json.loads(inside.read(run, "report.json")).get("angles")
        return angles if angles in ANGLES else "deg"
    return "deg"


def seen_in(run: Path, in_memory: Mapping[str, Any] = {}) -> tuple[RunView, Surroundings]:
    """A run folder and its last block, corrected image points and solution."""
    seen = view(run, in_memory)
    return seen, Surroundings(seen.last(Block), seen.last(ImagePoints), seen.last(Solution))


def refuse_others(run: Path, names: Mapping[str, Any] | tuple[str, ...]) -> None:
    """Refuse to write over a file that is no report."""
    for name in names:
        if inside.kind(run, name) == "file" and not any(o in inside.read(run, name)[:OURS_WITHIN] for o in OURS):
            remedy = "move it, or give the run a folder of its own (`run:` in pipeline.yaml)"
            raise ArtifactError(
                "is not a report of aatri's, and is not overwritten", where=str(run / name), remedy=remedy
            )


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("aatri.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    texts: dict[str, Any] = {"number": number, "seconds": seconds, "moment": moment, "in_words": in_words}
    environment.filters |= texts | {"coded": _coded, "drawn": drawn}
    return environment


@dataclass(frozen=True)
class Contents:
    """What a page says."""

    first_page: dict[str, Any]
    answers: Sequence[PageSection]
    """To the questions that follow the first page."""
    stages: Sequence[tuple[StageView, PageSection]]


def page_contents(run: RunView, around: Surroundings, *, stages: bool = True) -> Contents:
    """What the page of a run says; of its stages, where they are asked for, in a thread of their own."""
    with ThreadPoolExecutor(1) as beside:

        def of_stages() -> list[tuple[StageView, PageSection]]:
            return [(stage, section(run, stage, around)) for stage in run.stages if stages]

        coming = beside.submit(copy_context().run, of_stages)  # which knows in what angles are told
        page, answers = first_page(run, around), questions(run, around)
        return Contents(page, answers, coming.result())


def render(
    run: RunView, around: Surroundings, contents: Contents, *, printed: bool = False, summary: bool = False
) -> str:
    """The page as text.

    Parameters
    ----------
    printed : bool
        For paper: long tables are open.
    summary : bool
        The first page, the plan and the differences alone.
    """
    environment = _environment()
    script = environment.get_template("script.js").render()
    answers = [s.in_short() for s in contents.answers if s.name in OF_SUMMARY] if summary else contents.answers
    return environment.get_template("report.html").render(
        name=around.block.name if around.block else run.folder.resolve().name,
        run=run,
        command=command_of(run.overview),
        started=run.overview.get("started", ""),
        total=seconds(sum(float(s.record.get("seconds") or 0.0) for s in run.stages if s.record)),
        software=_software(run.stages),
        page=contents.first_page,
        failures=[s for s in run.stages if s.failure is not None],
        classes=around.classes,
        gates=_gates(run),
        sections=answers,
        names={s.name: s.title for s in answers},
        stages=[] if summary else contents.stages,
        environments=_environments(run.stages),
        colours=list(COLOURS),
        script=Markup(script),  # ours, and the policy knows its digest
        script_digest="sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        printed=printed,
        summary=summary,
    )


def first_page(run: RunView, around: Surroundings) -> dict[str, Any]:
    """What the first page says, as plain values: report.json has the same."""
    internal, external = internal_lights(run, around.solution), external_lights(run)
    evaluation, evaluations = run.last(Evaluation), run.evaluated()
    classes = around.classes
    return {
        "judgement": judgement(run),
        "accuracy_statement": accuracy_statement(numbers_of(evaluations[-1].metrics)) if evaluations else "",
        "verdict": " ".join(evaluation.verdict.splitlines()) if evaluation else "The accuracy was not evaluated.",
        "done": _was_done(run, around),
        "facts": facts(around.block, around.solution),
        "blocks": _of_which_block(run),
        "problems": [asdict(problem) for problem in problems(run, [*internal, *external])],
        "internal": [asdict(light) for light in internal],
        "external": [asdict(light) for light in external],
        "observations": [dict(zip(classes.heads, row)) for row in classes.rows] if classes else [],
        "parameters": _estimated(run),
        "counts": _counts(run),
        "figures": {stage.name: dict(stage.metrics) for stage in run.stages if stage.metrics},
    }


def _was_done(run: RunView, around: Surroundings) -> str:
    """What the last adjustment was made of and how; nothing where its Solution cannot be read, as the problems say."""
    last = next((stage for stage in run.of_kind(Solution)[-1:] if stage.name in run.readable(Solution)), None)
    return was_done(around.solution, around.block, last.use, (last.record or {}).get("options", {})) if last else ""


def _estimated(run: RunView) -> dict[str, Any]:
    """Parameters of the last Solution; nothing where that cannot be read, which the problems say."""
    solutions, last = run.readable(Solution), [stage.name for stage in run.of_kind(Solution)][-1:]
    return next((parameter_summary(name, solutions[name]) for name in last if name in solutions), {})


def _of_which_block(run: RunView) -> str:
    """Of several blocks in a run, the one that the page is about."""
    sources = [stage.name for stage in run.of_kind(Block) if not stage.inputs]
    name = next(iter(run.readable(Block)), "")
    return f"Blocks of this run: {', '.join(sources)}. This page is about {name}." if name and sources[1:] else ""


def _coded(text: str) -> Markup:
    """A message with what stands between backticks as code."""
    return Markup(re.sub(r"`([^`\n]+)`", r"<code>\1</code>", str(escape(text))))


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
    name, solutions = next(iter(run.readable(Block)), ""), run.of_kind(Solution)
    of_block: Mapping[str, Any] = next((s.metrics for s in run.stages if s.name == name), {})
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
        if name == "strips" and solved.get("images") == 0:  # of images that take no part
            continue
        if name in solved and name in of_block and solved[name] != of_block[name]:
            if solved[name]:  # a network has images that take no part
                counts[name.replace("_", " ")] = f"{number(solved[name])} of {number(of_block[name])}"
        elif solved.get(name, of_block.get(name)) or (name in of_block and of_block.get("images")):  # of a network few
            counts[name.replace("_", " ")] = number(solved.get(name, of_block.get(name)))
    return counts


def _software(stages: tuple[StageView, ...]) -> str:
    """The version of aatri that made the last stage."""
    versions = [
        stage.record["environment"].get("aatri", "")
        for stage in stages
        if stage.record and "environment" in stage.record
    ]
    return f"aatri {versions[-1]}" if versions and versions[-1] else ""


def _environments(stages: tuple[StageView, ...]) -> list[tuple[str, Mapping[str, str]]]:
    """Versions the stages ran with, one entry for all stages that share them."""
    groups: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for stage in stages:
        if stage.record and stage.record.get("environment"):
            groups.setdefault(tuple(sorted(stage.record["environment"].items())), []).append(stage.name)
    return [(", ".join(names), dict(versions)) for versions, names in groups.items()]
