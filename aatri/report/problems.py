"""What is to be looked at first, the worst first: failures, contradictions, what is wrong by name, lights, warnings."""

from collections.abc import Iterable
from dataclasses import dataclass

from aatri.artifacts.solution import Solution
from aatri.ids import shown
from aatri.notes import CONTRADICTION
from aatri.report.judgement import wrong_observations
from aatri.report.verdict import BAD, LOOK, Light
from aatri.report.view.numbers import number
from aatri.report.view.run_view import RunView

MOST_IMAGES = 5


@dataclass(frozen=True)
class ReportedProblem:
    """One problem: what it is, what to do, and the stage where more of it stands."""

    text: str
    remedy: str = ""
    stage: str = ""


def problems(run: RunView, lights: Iterable[Light]) -> list[ReportedProblem]:
    """Everything that a reader should look at before the figures."""
    made = [
        ReportedProblem(f"Stage {s.name} failed: {s.failure['what']}", str(s.failure.get("remedy") or ""), s.name)
        for s in run.stages
        if s.failure is not None
    ]
    warnings = [ReportedProblem(str(w["message"]), stage=str(w["stage"])) for w in run.overview.get("warnings") or ()]
    contradictions = [warning for warning in warnings if CONTRADICTION in warning.text]
    solution = run.last(Solution)
    of_solution = list[ReportedProblem]()
    if solution is not None:
        stage = run.of_kind(Solution)[-1].name
        of_solution = [ReportedProblem(text, "see the suspects there", stage) for text in wrong_observations(solution)]
        missing = solution.images.id[~solution.images.oriented]
        if 0 < len(missing) < len(solution.images):
            count = f"{number(len(missing))} of {number(len(solution.images))} images are not oriented"
            of_solution.append(
                ReportedProblem(f"{count}: {shown(missing.tolist(), MOST_IMAGES)}", "why: the log there", stage)
            )
    said_already = (
        "Chain",
        "Suspects",
        "Independent check",
    )  # by the failures and observations above, and the accuracy
    of_lights = [
        ReportedProblem(f"{light.title}: {light.words}")
        for light in lights
        if light.state in (BAD, LOOK) and light.title not in said_already
    ]
    return [*made, *contradictions, *of_solution, *of_lights, *(w for w in warnings if w not in contradictions)]
