"""What is to be looked at first, the worst first: failures, contradictions, what is wrong by name, lights, warnings."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.notes import CONTRADICTION, EXCHANGED, FAR_OFF, REJECTED
from aatri.report.judgement import not_oriented, wrong_image_points, wrong_observations
from aatri.report.verdict import BAD, LOOK, Light
from aatri.report.view.numbers import NOUNS, spoken
from aatri.report.view.run_view import RunView


@dataclass(frozen=True)
class ReportedProblem:
    """One problem: what it is, what to do, the stage it is of, and the section of the page where more of it stands."""

    text: str
    remedy: str = ""
    stage: str = ""
    section: str = ""


KINDS = r"\b(image_point|ground_point|model_tie|strip_tie)(?=[ ,):])"
FIRST_WORD = r"(rejected|doubtful)\b|[a-z]+[ ,]"
LACKS = "The result of {} cannot be read, and what this page would say from it is missing"
OF_OBSERVATIONS = {
    "control": "compare numbers and coordinates with their source, then measure again in the images",
    "position": "compare times and antenna with the record of the flight",
}
MOST_LISTED = 10
"""Of what is left out by name; the section has the others."""
OF_EXCHANGE = ("`aatri edit` proposes the exchange", "tests")
"""What to do about points that fit with exchanged numbers, and the section that has them."""
OF_IMAGE_POINTS = "measure them again; `aatri edit` proposes how to set them right"
"""What to do about image points that are left out."""
OTHERWISE = "compare with the field book or the measurement"
REMEDIES = {
    "Convergence": ("see at which iteration it stays; a better start or fewer free parameters help", "convergence"),
    "sigma0": ("see which group of observations does not follow the standard deviations given", "residuals"),
    "Check against theory": ("look for a pattern: in the differences, then in the image residuals", "accuracy"),
    "Check points far off": (
        "where a few are, compare their numbers and coordinates with their source; where most are, look for a "
        "pattern in the differences",
        "accuracy",
    ),
    "Truth against theory": ("look for a pattern in the errors", "accuracy"),
}
"""What to do where a light is not green, and the section that tells more."""


def problems(run: RunView, lights: Iterable[Light]) -> list[ReportedProblem]:
    """Everything that a reader should look at before the figures."""
    failures = [
        ReportedProblem(f"Stage {s.name} failed: {s.failure['what']}", str(s.failure.get("remedy") or ""), s.name)
        for s in run.stages
        if s.failure is not None
    ]
    failures += [
        ReportedProblem(f"{refusal['where']}: {refusal['what']}", str(refusal["remedy"]))
        for refusal in run.overview.get("refused") or ()
    ]
    failures += _unreadable(run)
    warnings = [
        ReportedProblem(in_words(str(w["message"])), stage=str(w["stage"])) for w in run.overview.get("warnings") or ()
    ]
    warnings += _of_stages(run)
    contradictions = [warning for warning in warnings if CONTRADICTION in warning.text.lower()]
    dull = [  # of the others failures and observations tell
        light
        for light in sorted(lights, key=lambda light: light.state != BAD)
        if light.state in (BAD, LOOK) and light.title in REMEDIES
    ]
    causes = {light.title: w for light in dull for w in warnings if w.text.startswith(f"{light.title} ")}
    of_lights = [
        ReportedProblem(causes[title].text if title in causes else f"{title}: {words}", *_remedy(title))
        for title, words in ((light.title, light.words) for light in dull)
    ]
    others = [w for w in warnings if w not in contradictions and w not in causes.values()]
    return [*failures, *contradictions, *_of_solution(run), *of_lights, *others]


def _of_stages(run: RunView) -> list[ReportedProblem]:
    """Warnings of what was read, of its image points, of the last result and of its evaluations.

    Stages between have theirs beside them: the next one tests again what they tell. No other stage sees fiducial marks.
    """
    solutions = run.of_kind(Solution)
    earlier = {stage.name for stage in solutions[:-1]}
    evaluations = [stage for stage in run.of_kind(Evaluation) if not earlier & set(stage.inputs.values())]
    asked = [*run.of_kind(Block), *run.of_kind(ImagePoints), *solutions[-1:], *evaluations] if solutions else run.stages
    return [
        _of_warning(str(warning), stage.name)
        for stage in asked
        for warning in (stage.record or {}).get("warnings", ())
        if REJECTED not in warning and FAR_OFF not in warning  # of them observations and a light tell
    ]


def _of_warning(warning: str, stage: str) -> ReportedProblem:
    remedy, section = OF_EXCHANGE if EXCHANGED in warning else ("", "")
    return ReportedProblem(in_words(warning), remedy, stage, section)


def in_words(warning: str) -> str:
    """A warning as a sentence: kinds of observations have names (`image_point: 3 of 9 ...`), a first word is capital.

    A word with a colon behind it may be an id, and ids stay as they are.
    """
    kind, colon, rest = warning.partition(": ")
    named = colon and (kind in NOUNS or (kind.isidentifier() and "_" in kind))
    text = f"{spoken(kind).capitalize()}s: {rest}" if named else warning
    text = re.sub(KINDS, lambda match: spoken(match[1]), text)
    return f"{text[0].upper()}{text[1:]}" if re.match(FIRST_WORD, text) else text


def _unreadable(run: RunView) -> list[ReportedProblem]:
    """Results that are there and cannot be read: what the page would show of them is missing."""
    for kind in (Block, ImagePoints, Solution, Evaluation):
        run.last(kind)
    return [
        ReportedProblem(f"{LACKS.format(stage)}: {error.what}", error.remedy or "aatri run", stage)
        for stage, error in run.unreadable.items()
    ]


def _of_solution(run: RunView) -> list[ReportedProblem]:
    """Observations that are left out, and images that are not oriented."""
    solution = run.last(Solution)
    if solution is None:
        return []
    stage = run.of_kind(Solution)[-1].name
    made = [
        ReportedProblem(
            text, f"{OF_OBSERVATIONS.get(kind, OTHERWISE)}; `aatri edit` proposes how to set it right", stage, "tests"
        )
        for kind, text in wrong_observations(solution, MOST_LISTED).items()
    ]
    if text := wrong_image_points(solution, run.last(Block), MOST_LISTED):
        made.append(ReportedProblem(text, OF_IMAGE_POINTS, stage, "tests"))
    if text := not_oriented(solution):
        made.append(ReportedProblem(text, "see their ties; the log of the stage says why", stage, "ties"))
    return made


def _remedy(title: str) -> tuple[str, str, str]:
    remedy, section = REMEDIES[title]
    return remedy, "", section
