"""What a run has to do and why: a pure function of the stages and of a view of the store.

A stage is *fresh* if the store holds a whole result under its key; it has to *run* if it does not; and it is *maybe*
where the content of an input is not known before a stage above it has been made again: if that gives what it gave
before, nothing below it runs. While a run goes on the same function decides each stage anew from what is known then.
`run`, `status`, `dag` and `--dry-run` all carry out or show this one plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from aatri.errors import SpecError
from aatri.ids import did_you_mean
from aatri.pipeline.plan.graph import StageNode, downstream, upstream
from aatri.pipeline.plan.keys import key_of, key_parts
from aatri.pipeline.plan.reasons import Reason, Why, differences

if TYPE_CHECKING:
    from aatri.pipeline.plan.view import StoreView


class State(StrEnum):
    """What is to be done with a stage."""

    fresh = "fresh"
    run = "run"
    maybe = "maybe"


class Integrity(StrEnum):
    """Whether the file of a result is what was written."""

    intact = "intact"
    missing = "output_missing"
    altered = "output_altered"


@dataclass(frozen=True)
class Decision:
    """What to do with a stage."""

    stage: str
    state: State
    reasons: tuple[Reason, ...]
    parts: Mapping[str, Any] = field(repr=False)
    key: str | None = None
    """The key, and above what it is made of; None where an input is not known yet."""
    record: Mapping[str, Any] | None = field(default=None, repr=False)
    """The record of the result that serves, if it is fresh."""
    accepted: bool = False
    """Whether the user accepted a result of other code."""
    selected: bool = True
    """Whether the run is to touch it."""

    @property
    def digest(self) -> str | None:
        """Content digest of the result, if it is there."""
        return str(self.record["output"]["content_digest"]) if self.record is not None else None


@dataclass(frozen=True)
class Plan:
    """The decisions of all stages, in the order of execution."""

    decisions: tuple[Decision, ...]

    def of(self, stage: str) -> Decision:
        """The decision on a stage."""
        return next(d for d in self.decisions if d.stage == stage)

    @property
    def stale(self) -> tuple[Decision, ...]:
        """What the run has to do, or perhaps to do."""
        return tuple(d for d in self.decisions if d.selected and d.state is not State.fresh)


@dataclass(frozen=True)
class Selection:
    """Which stages a run touches, and which it makes again whatever the store holds."""

    stages: frozenset[str] | None = None
    forced: frozenset[str] = frozenset()


def select(
    nodes: tuple[StageNode, ...],
    *,
    start: str | None = None,
    until: str | None = None,
    only: Sequence[str] = (),
    force: Sequence[str] = (),
) -> Selection:
    """The selection of a command line.

    Parameters
    ----------
    start : str, optional
        This stage and what depends on it.
    until : str, optional
        This stage and what it depends on.
    only : sequence of str
        These stages.
    force : sequence of str
        Made again; `all` means every selected stage.

    Raises
    ------
    SpecError
        If there is no such stage.
    """
    names = [node.name for node in nodes]
    for option, stages in (("--from", [start]), ("--until", [until]), ("--only", only), ("--force", force)):
        for name in stages:
            if name is not None and name not in names and not (name == "all" and option == "--force"):
                hint = did_you_mean(name, names) or f"; there are {', '.join(names)}"
                raise SpecError(f"no stage {name!r}{hint}", where=f"{option} {name}")
    chosen = set(names)
    if start is not None:
        chosen &= {start, *downstream(nodes, start)}
    if until is not None:
        chosen &= {until, *upstream(nodes, until)}
    if only:
        chosen &= set(only)
    forced = frozenset(chosen) if "all" in force else frozenset(force) & chosen
    return Selection(frozenset(chosen), forced)


def plan(nodes: tuple[StageNode, ...], view: StoreView, seed: int, selection: Selection = Selection()) -> Plan:
    """Decide on every stage, in order."""
    digests: dict[str, str | None] = {}
    decisions = []
    for node in nodes:
        decision = decide(node, digests, view, seed, selection)
        digests[node.name] = decision.digest if decision.state is State.fresh else None
        decisions.append(decision)
    return Plan(tuple(decisions))


def decide(
    node: StageNode, digests: Mapping[str, str | None], view: StoreView, seed: int, selection: Selection = Selection()
) -> Decision:
    """Decide on one stage.

    Parameters
    ----------
    digests : mapping
        Stage -> content digest of its result; None where it is still to be made.
    selection : Selection, optional
    """
    inputs = {port: digests[source] for port, source in node.inputs.items()}
    parts = key_parts(node, inputs, view.files(node), seed)
    selected = selection.stages is None or node.name in selection.stages
    forced = (Reason(Why.forced),) if node.name in selection.forced else ()
    open_ = sorted({source for source in node.inputs.values() if digests[source] is None})
    if open_:
        above = tuple(Reason(Why.upstream_maybe, source) for source in open_)
        may_serve = not forced and any(_same_but_inputs(r["parts"], parts) for r in view.records(node.name))
        reasons = forced or _why(node.name, None, parts, view)
        state = State.maybe if may_serve else State.run
        return Decision(node.name, state, reasons + above, parts, selected=selected)
    key = key_of(parts)
    record, accepted = _serving(node.name, key, parts, view)
    integrity = view.integrity(record) if record is not None else None
    if integrity is Integrity.intact and not forced:
        return Decision(node.name, State.fresh, (), parts, key, record, accepted, selected)
    broken = (Reason(Why(integrity.value)),) if integrity is not None and integrity is not Integrity.intact else ()
    reasons = forced + broken or _why(node.name, key, parts, view) or (Reason(Why.output_missing),)
    return Decision(node.name, State.run, reasons, parts, key, selected=selected)


def _serving(stage: str, key: str, parts: Mapping[str, Any], view: StoreView) -> tuple[Mapping[str, Any] | None, bool]:
    """The record under a key, or the one that the user accepts in its stead; and whether it is the latter."""
    record = view.record(stage, key)
    if record is not None and record["parts"] == parts:
        return record, False
    other = view.accepted(stage, key)
    return (view.record(stage, other), True) if other is not None else (None, False)


def _why(stage: str, key: str | None, parts: Mapping[str, Any], view: StoreView) -> tuple[Reason, ...]:
    """What became different since the last result, and how the last attempt ended."""
    ends = []
    if key is not None and view.failed_key(stage) == key:
        ends.append(Reason(Why.failed_before))
    if key is not None and view.interrupted_key(stage) == key:
        ends.append(Reason(Why.interrupted))
    last = view.last(stage)
    changed = differences(last["parts"], parts) if last is not None else (() if ends else (Reason(Why.never_run),))
    return (*ends, *changed)


def _same_but_inputs(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    return {**old, "inputs": sorted(old["inputs"])} == {**new, "inputs": sorted(new["inputs"])}
