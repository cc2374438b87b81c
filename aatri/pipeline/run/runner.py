"""Carries out a plan: makes what is stale, decides anew on what depends on it, and makes the results current.

At the end the gates of the stages that were asked for are judged; run.json says how, and the caller tells it.

Whatever ends a run - an error, a signal, a full disk, a loss of power - the results made before it stay, and the same
command goes on from there.
"""

import contextlib
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from aatri.errors import AatriError, ResourceError, raise_all
from aatri.pipeline.plan.decisions import Decision, Plan, Selection, State, decide, plan
from aatri.pipeline.plan.graph import StageNode
from aatri.pipeline.plan.preconditions import check_inputs
from aatri.pipeline.plan.unused import unused
from aatri.pipeline.plan.view import StoreView
from aatri.pipeline.run.overview import DONE, GATE_FAILED, cannot_be_written, finished, overview_of, plain_warnings
from aatri.pipeline.run.task import StageSource, TaskOutcome, task_of
from aatri.pipeline.run.workers import WorkerPool, pool
from aatri.pipeline.spec.gates import Verdict, judge
from aatri.pipeline.spec.pipeline_file import Spec
from aatri.pipeline.store import inside
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.events import Events
from aatri.pipeline.store.inside import on_disk
from aatri.pipeline.store.known_runs import remember
from aatri.pipeline.store.lock import locked
from aatri.pipeline.store.provenance import now
from aatri.pipeline.store.records import is_stage_name


class Listener(Protocol):
    """Is told what happens during a run."""

    def planned(self, plan: Plan, expected: Mapping[str, float]) -> None:
        """Take what is to be done, and the seconds that stages took before."""

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        """Take that a stage begins."""

    def logged(self, stage: str, message: str) -> None:
        """Take a line of the log of a stage."""

    def warned(self, stage: str, message: str) -> None:
        """Take a warning of a stage."""

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Take how far a stage is."""

    def finished(self, record: Mapping[str, Any]) -> None:
        """Take the record of a stage that is done."""

    def failed(self, stage: str, folder: Path) -> None:
        """Take that a stage failed, and where its log lies."""


@dataclass(frozen=True)
class RunSettings:
    """How to run: what the command line says beside the pipeline itself.

    `cluster` is that of `dask_pool`; `compiled` comes back when some modules have been compiled; `in_memory` gets what
    is made in this process, by content digest, for who reads the results next.
    """

    selection: Selection = field(default_factory=Selection)
    jobs: int = 1
    cluster: Any = ""
    keep_going: bool = False
    verify: bool = False
    lock: bool = True
    command: str = "aatri run"
    source: StageSource = field(default_factory=StageSource)
    request: Mapping[str, Any] = field(default_factory=dict)
    compiled: Callable[[Iterable[str]], object] | None = None
    in_memory: dict[str, Any] = field(default_factory=dict)


def run_pipeline(
    spec: Spec, nodes: tuple[StageNode, ...], listener: Listener, settings: RunSettings | None = None
) -> list[dict[str, Any]]:
    """Bring all selected stages up to date; returns the records of the stages that are, in order.

    A gate that fails is no error here: `gates.judge` gives the same verdicts to who is to tell of them.

    Raises
    ------
    AatriError
        The errors of the stages that failed. What was made before stays.
    """
    settings = settings or RunSettings()
    try:
        return _run(spec, nodes, listener, settings)
    except ResourceError as error:
        if not cannot_be_written(error):
            raise
        view = StoreView(spec.run, verify=settings.verify)
        if (done := finished(spec, nodes, listener.warned, settings.selection, view)) is None:
            raise
        return done


def _run(spec: Spec, nodes: tuple[StageNode, ...], listener: Listener, settings: RunSettings) -> list[dict[str, Any]]:
    """Bring all selected stages up to date, as the one writer of the folder."""
    store.claim(spec.run, spec.variant)
    remember(spec.run, str(settings.request.get("pipeline", "")))
    with locked(spec.run, settings.command, enabled=settings.lock):
        view = StoreView(spec.run, verify=settings.verify)
        planned = plan(nodes, view, spec.seed, settings.selection)
        check_inputs(spec, nodes, planned)
        view.save()
        if (done := finished(spec, nodes, listener.warned, settings.selection, view, planned)) is not None:
            return done
        run = _Run(spec, nodes, planned, view, listener, settings)
        try:
            return run.carry_out()
        finally:
            view.save()


class _Run:
    """One run under way."""

    def __init__(
        self,
        spec: Spec,
        nodes: tuple[StageNode, ...],
        planned: Plan,
        view: StoreView,
        listener: Listener,
        settings: RunSettings,
    ) -> None:
        self.spec, self.nodes, self.planned = spec, nodes, planned
        self.view, self.listener, self.settings = view, listener, settings
        self.overview = {**overview_of(spec, nodes, settings.request), "started": now()}
        self.records: dict[str, Mapping[str, Any]] = {}
        self.numbers = {node.name: k for k, node in enumerate(nodes, 1)}
        self.problems: list[AatriError] = []
        self.refused: list[dict[str, str]] = []
        self.lost: set[str] = set()
        self.warnings: list[tuple[str, str]] = []
        self.verdicts: tuple[Verdict, ...] = ()

    def carry_out(self) -> list[dict[str, Any]]:
        """Run to the end, and leave word in run.json of how it ended."""
        run = self.spec.run
        store.begin(run, {**self.overview, "status": "running"})
        self.events = Events(run)
        status = "interrupted"
        try:
            self._show_what_is_fresh()
            self.events.add("started", command=self.settings.command, stale=[d.stage for d in self.planned.stale])
            with pool(
                self.settings.jobs,
                self._tell,
                cluster=self.settings.cluster,
                run=self.spec.run,
                in_memory=self.settings.in_memory,
            ) as workers:
                self._work(workers)
            status = "failed" if self.problems else self._judge()
        except AatriError:
            status = "failed"
            raise
        finally:
            with contextlib.suppress(AatriError) if status not in (DONE, GATE_FAILED) else contextlib.nullcontext():
                self._leave_word(status)
        raise_all(self.problems)
        return [dict(self.records[node.name]) for node in self.nodes if node.name in self.records]

    def _judge(self) -> str:
        """Judge the gates; returns the status of the run."""
        self.verdicts = judge(self.spec, self.records.values(), self.settings.selection.stages)
        for verdict in self.verdicts:
            self.events.add("gate", **verdict.plain())
        return DONE if all(verdict.passed for verdict in self.verdicts) else GATE_FAILED

    def _leave_word(self, status: str) -> None:
        self.events.add("ended", status=status)
        self.events.close()
        with on_disk(self.spec.run):
            store.write_json(self._last_word(status), self.spec.run, "run.json")

    def _last_word(self, status: str) -> dict[str, Any]:
        ends = {"warnings": plain_warnings(self.warnings), "gates": [verdict.plain() for verdict in self.verdicts]}
        return {**self.overview, **ends, "refused": self.refused, "status": status, "ended": now()}

    def _show_what_is_fresh(self) -> None:
        """Put the fresh results into `current` and take all others out."""
        run = self.spec.run
        expected = {}
        for decision in self.planned.decisions:
            last = store.last_record(run, decision.stage)
            if last is not None and decision.state is not State.fresh:
                expected[decision.stage] = float(last["seconds"])
            if decision.record is not None:
                self._settle(decision.stage, decision.record)
        shown = {name.partition(".")[0] for name in inside.names_in(run, "current")}
        others = set(filter(is_stage_name, shown)) - {n.name for n in self.nodes}
        store.withdraw(run, sorted(others | {d.stage for d in self.planned.decisions if d.record is None}))
        self.listener.planned(self.planned, expected)

    def _settle(self, stage: str, record: Mapping[str, Any]) -> None:
        if not store.is_current(self.spec.run, record):
            store.make_current(self.spec.run, record)
        self.records[stage] = record
        self._compare_with_use(record)

    def _compare_with_use(self, record: Mapping[str, Any]) -> None:
        """Nothing is made of a result that offers what no stage uses."""
        stage = str(record["stage"])
        not_used = unused(self.nodes, [record], self.spec.ignore)
        for _, message in not_used.warnings:
            self.warnings.append((stage, message))
            self._tell(stage, "warned", message)
        if not_used.errors:
            self.lost.add(stage)
            self.problems += not_used.errors
            self.refused += [{"where": e.where, "what": e.what, "remedy": e.remedy} for e in not_used.errors]
            self.events.add("not used", stage=stage, errors=[str(error) for error in not_used.errors])

    def _work(self, workers: WorkerPool) -> None:
        selected = {d.stage for d in self.planned.decisions if d.selected}
        waiting = [n for n in self.nodes if n.name in selected and n.name not in self.records]
        under_way: dict[Future[TaskOutcome], StageNode] = {}
        while waiting or under_way:
            node = self._next(waiting) if len(under_way) < workers.jobs and self._goes_on() else None
            if node is not None:
                waiting.remove(node)
                digests = {name: str(r["output"]["content_digest"]) for name, r in self.records.items()}
                decision = decide(node, digests, self.view, self.spec.seed, self.settings.selection)
                if decision.record is not None:
                    self._settle(node.name, decision.record)
                    self.events.add("fresh", stage=node.name, key=decision.key)
                    continue
                under_way[self._start(node, decision, workers)] = node
                if workers.jobs > 1:
                    continue
            if not under_way:
                return
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                self._end(under_way.pop(future), future.result())

    def _goes_on(self) -> bool:
        return self.settings.keep_going or not self.problems

    def _next(self, waiting: list[StageNode]) -> StageNode | None:
        """The first stage whose inputs are there; those below a failed one are given up."""
        for node in list(waiting):
            if self.lost & set(node.inputs.values()):
                self.lost.add(node.name)
                waiting.remove(node)
            elif all(source in self.records for source in node.inputs.values()):
                return node
        return None

    def _start(self, node: StageNode, decision: Decision, workers: WorkerPool) -> Future[TaskOutcome]:
        self.listener.started(node.name, node.method.name, self.numbers[node.name], len(self.nodes))
        self.events.add(
            "stage started", stage=node.name, key=decision.key, reasons=[reason.plain() for reason in decision.reasons]
        )
        if self.settings.compiled is not None:
            self.settings.compiled(node.code.modules)
        return workers.submit(task_of(self.spec, node, decision, self.records, self.settings.source))

    def _end(self, node: StageNode, outcome: TaskOutcome) -> None:
        if outcome.record is not None:
            self._settle(node.name, outcome.record)
            self.view.committed(outcome.record)
            self.events.add("stage done", stage=node.name, key=outcome.record["key"],
                            content_digest=outcome.record["output"]["content_digest"])  # fmt: skip
            self.listener.finished(outcome.record)
            return
        self.lost.add(node.name)
        try:
            outcome.raise_error()
        except AatriError as error:
            self.problems.append(error)
            self.events.add("stage failed", stage=node.name, error=str(error))
            self.listener.failed(node.name, self.spec.run / "failed" / node.name)

    def _tell(self, stage: str, event: str, *about: Any) -> None:
        if event == "warned":
            self.events.add("warning", stage=stage, message=about[0])
        getattr(self.listener, event)(stage, *about)
