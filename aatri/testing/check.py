"""Checks whether a stage keeps its contract: for authors of plugins, and for aatri's own stages.

    from aatri.testing.check import check_stage

    def test_mine_keeps_its_contract():
        check_stage("interior_orientation/mine", local=Path("stages"))

The stage runs on small made-up blocks, one of film and one digital. One of them it may refuse with an InputError or
GeometryError, if it cannot take it. What must hold is said in `SENTENCES`; every breach is reported at once. That
results are right is judged by the truth of the example (`beside_truth`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aatri.artifacts.block import Block
from aatri.errors import AatriError, GeometryError, InputError, PluginError
from aatri.pipeline.methods.registry import find_stages
from aatri.plugin import Options, Role, StageCard
from aatri.tables.digest import content_digest
from aatri.tables.schema import Artifact
from aatri.testing.beside_truth import properties
from aatri.testing.example_inputs import EXAMPLES, example_block, example_inputs
from aatri.testing.stage_trial import Outcome, anonymous, call, difference, other_rows, unlike_its_file

SENTENCES = {
    "contract": "the function, its ports, its kind and its options are those of its role",
    "method": "the file begins with its method: a sentence, then equation, symbols, source; the function has one too",
    "options": "every option has a description; the defaults are valid, also as written in pipeline.yaml",
    "uses": "it says what it uses of what its ports offer, by the names that these have",
    "runs": "it runs on an example; what it cannot take it refuses with an InputError or GeometryError",
    "kind": "it returns the kind of its role",
    "file": "what it returns is the same after writing and reading, and has metrics",
    "repeatable": "the same input gives the same content, to the bit",
    "defaults": "options and context may be left out",
    "optional ports": "optional ports may be left out",
    "truth": "the truth of a simulated block changes nothing",
    "provenance": "files and lines of the input change nothing",
    "order": "the order of the rows of the input files changes nothing",
    "rows": "images, points and image points are those of the Block, in its rows",
    "rotations": "rotation matrices are orthonormal and mirror nothing",
    "covariances": "covariance matrices are symmetric and have no negative variance",
    "photo coordinates": "photo coordinates are those of the true points in the true images, to 0.3 mm",
    "orientations": "orientations are the true ones, to 0.01 rad and 1 % of the flying height or base",
    "points": "points are the true ones, to 1 % of the flying height or distance",
    "standard deviations": "standard deviations are of the size of the true errors, to a factor of 3 (in photos 10)",
    "residuals": "residuals and parallaxes are those of the result, adjusted minus observed, in mm and m",
    "figures": "figures and differences are those of the solution that is evaluated",
    "inputs": "it leaves its inputs as they are",
    "quiet": "it prints nothing and gives no Python warning: what is to be told goes to `context`",
    "context": "what it tells `context` is text, and progress counts from 0 to the total",
    "files": "it writes no files",
}


@dataclass(frozen=True)
class Check:
    """What must hold, by name, and what was found instead; empty `breach` if it holds."""

    name: str
    breach: str = ""

    @property
    def sentence(self) -> str:
        """What must hold."""
        return SENTENCES[self.name]


@dataclass(frozen=True)
class Report:
    """All checks that were made of a stage."""

    stage: str
    checks: tuple[Check, ...]

    @property
    def breaches(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.breach)

    def __str__(self) -> str:
        lines = [f"  {c.name}: {c.sentence}\n    but {c.breach}" for c in self.breaches]
        return f"{self.stage}: {len(self.breaches)} of {len(self.checks)} checks fail\n" + "\n".join(lines)


def check_stage(
    name: str,
    local: Path | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Artifact] | None = None,
) -> Report:
    """Check a stage and refuse it if anything is wrong.

    Parameters
    ----------
    name : str
        `ROLE/VARIANT`.
    local : Path, optional
        A project's own folder of stages.
    options : mapping, optional
        Options to run it with; needed where some have no default.
    inputs : mapping of port to Artifact, optional
        Inputs to run it on instead of the examples; needed where a port takes a kind of a third party.

    Raises
    ------
    PluginError
        With every breach.
    """
    report = examine_stage(name, local, options=options, inputs=inputs)
    if report.breaches:
        raise PluginError(str(report), remedy="see docs/plugins.md")
    return report


def examine_stage(
    name: str,
    local: Path | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Artifact] | None = None,
) -> Report:
    """The report of `check_stage`, also where something is wrong."""
    try:
        registry = find_stages(local)
        card = registry.card(name)
        examples = {"given": dict(inputs)} if inputs is not None else _examples(card.role, registry.role(card.role))
    except PluginError as error:
        return Report(name, (Check("contract", str(error)),))
    chosen, wrong = _options(card, options)
    faults = wrong or _undescribed(card) or _unwritable(chosen)
    checks = [Check("contract"), Check("method", _method(card)), Check("options", faults)]
    checks += [] if wrong else [Check("uses", _uses(card, chosen))]
    if not wrong:
        checks += _behaviour(card, examples, chosen, defaults=options is None)
    return Report(name, tuple(checks))


def _examples(role: str, declared: Role) -> dict[str, dict[str, Artifact]]:
    names = EXAMPLES if declared.ports else EXAMPLES[:1]  # without ports all examples are the same
    return {name: example_inputs(role, declared, name) for name in names}


def _method(card: StageCard) -> str:
    first, _, rest = card.doc.strip().partition("\n")
    if not first.strip().endswith("."):
        return f"its first line is {first!r}, not a sentence"
    if not rest.strip():
        return "there is only a first line"
    return "" if (card.function.__doc__ or "").strip() else f"the function {card.variant} has no docstring"


def _options(card: StageCard, values: Mapping[str, Any] | None) -> tuple[Options | None, str]:
    if card.options is None:
        return None, "it takes no options, but some are given" if values else ""
    needed = [name for name, declared in card.options.model_fields.items() if declared.is_required()]
    if values is None and needed:
        return None, f"{', '.join(needed)} must be given: check_stage({card.name!r}, options={{...}})"
    try:
        return card.options.model_validate(dict(values or {}), context={"base": Path.cwd()}), ""
    except ValidationError as error:
        return None, "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())


def _uses(card: StageCard, chosen: Options | None) -> str:
    offering = [port.name for port in card.ports if port.kind.offered_names()]
    try:
        stated = card.used_with(chosen)
    except PluginError as error:
        return error.what
    if stated is None and offering:
        return f"it does not say what it uses of {', '.join(offering)}: @stage(version=..., uses=(...)), or uses=()"
    return ""


def _undescribed(card: StageCard) -> str:
    schema = card.options.model_json_schema() if card.options else {}
    models = [("", schema), *((f"{name}.", model) for name, model in schema.get("$defs", {}).items())]
    names = [
        prefix + name
        for prefix, model in models
        for name, about in model.get("properties", {}).items()
        if not about.get("description")
    ]
    return f"no description: {', '.join(names)}" if names else ""


def _unwritable(chosen: Options | None) -> str:
    """Options that pipeline.yaml could not give: a list serves as a tuple there, but a text not as a number."""
    if chosen is None:
        return ""
    try:
        read = type(chosen).model_validate_json(chosen.model_dump_json(), strict=True)
    except ValidationError as error:
        return "; ".join(
            f"{'.'.join(map(str, e['loc']))} as pipeline.yaml gives it: {e['msg']}" for e in error.errors()
        )
    return "" if read == chosen else "written and read they are others"


def _behaviour(
    card: StageCard, examples: Mapping[str, Mapping[str, Artifact]], options: Options | None, *, defaults: bool
) -> Iterator[Check]:
    """The checks of what it does, over all examples that it takes."""
    breaches: dict[str, list[str]] = {}
    refusals = []
    for example, inputs in examples.items():
        used = {port.name: inputs[port.name] for port in card.ports if port.name in inputs}
        first = call(card, used, options)
        results = [*first.manners.items()]
        if isinstance(first.error, (InputError, GeometryError)):
            refusals.append(f"{example}: {first.error}")
        elif first.error is not None:
            results.append(("runs", f"{type(first.error).__name__}: {first.error}"))
        else:
            results += _compared(card, example, used, options, first, defaults=defaults)
        for name, text in results:
            breaches.setdefault(name, []).extend([f"{example}: {text}"] if text else [])
    taken = breaches.setdefault("runs", [])
    if len(refusals) == len(examples):
        taken.extend(refusals)
    for name in SENTENCES:
        if name in breaches:
            yield Check(name, "; ".join(breaches[name]))


def _compared(
    card: StageCard,
    example: str,
    inputs: Mapping[str, Artifact],
    options: Options | None,
    first: Outcome,
    *,
    defaults: bool,
) -> Iterator[tuple[str, str]]:
    """What must hold of a call that succeeded, with what is wrong."""
    yield "kind", "" if isinstance(first.artifact, card.kind) else f"it returned a {type(first.artifact).__name__}"
    if not isinstance(first.artifact, card.kind):
        return
    yield "file", unlike_its_file(first.artifact)

    def same(what: str, outcome: Outcome) -> tuple[str, str]:
        if outcome.error is not None:
            return what, f"{type(outcome.error).__name__}: {outcome.error}"
        one, other = _untold(first.artifact), _untold(outcome.artifact)  # a Block hands its truth on
        return what, "" if content_digest(one) == content_digest(other) else difference(one, other)

    again = same("repeatable", call(card, inputs, options))
    yield again
    if again[1]:
        return  # what differs from itself differs from everything
    if defaults:
        yield same("defaults", call(card, inputs, None, sparing=True))
    needed = {port.name: inputs[port.name] for port in card.ports if not port.optional}
    if len(needed) < len(inputs):
        error = call(card, needed, options).error
        yield "optional ports", "" if error is None or isinstance(error, AatriError) else repr(error)
    blocks = {port: value for port, value in inputs.items() if isinstance(value, Block)}
    if blocks and card.kind.kind != "Evaluation":
        bare = {port: _untold(value) for port, value in blocks.items()}
        yield same("truth", call(card, {**inputs, **bare}, options))
    yield same("provenance", call(card, {port: anonymous(value) for port, value in inputs.items()}, options))
    if blocks and example in EXAMPLES:
        shuffled = dict.fromkeys(blocks, example_block(example, shuffle_seed=7))
        yield same("order", call(card, {**inputs, **shuffled}, options))
    for block in blocks.values():
        yield "rows", other_rows(block, first.artifact)
    for judged in properties(_with_truth(example, blocks), inputs, first.artifact):
        yield judged.name, judged.breach()


def _untold(artifact: Any) -> Any:
    """A Block without its truth; anything else as it is."""
    has_truth = isinstance(artifact, Block)
    return replace(artifact, true_images=None, true_points=None, gross_errors=None) if has_truth else artifact


def _with_truth(example: str, blocks: Mapping[str, Block]) -> Block | None:
    """The Block that a result is judged by: of an example with its truth, of given inputs without."""
    if example in EXAMPLES:
        return example_block(example)
    block = next(iter(blocks.values()), None)
    return block and replace(block, true_images=None, true_points=None)
