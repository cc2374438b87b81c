"""Makes one stage only, for schedulers that run every stage as a job of its own.

The stages above must be up to date; the run is shared with other jobs, the stage is not.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from aatri.errors import ArtifactError, raise_all
from aatri.pipeline.plan.decisions import Selection, plan
from aatri.pipeline.plan.graph import StageNode
from aatri.pipeline.plan.preconditions import check_inputs
from aatri.pipeline.plan.unused import unused
from aatri.pipeline.plan.view import StoreView
from aatri.pipeline.run.overview import overview_of
from aatri.pipeline.run.runner import Listener, RunSettings
from aatri.pipeline.run.task import task_of
from aatri.pipeline.run.workers import pool
from aatri.pipeline.spec.pipeline_file import Spec
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.inside import on_disk
from aatri.pipeline.store.lock import locked


def make_stage(
    spec: Spec, nodes: tuple[StageNode, ...], name: str, listener: Listener, settings: RunSettings
) -> tuple[dict[str, Any], bool]:
    """Bring one stage up to date.

    Returns
    -------
    dict, bool
        Its record, and whether it was made now.

    Raises
    ------
    ArtifactError
        If a stage above it is not up to date.
    AatriError
        If the stage fails.
    """
    node = next(node for node in nodes if node.name == name)
    store.claim(spec.run, spec.variant)
    with locked(spec.run, settings.command, stage=name, enabled=settings.lock):
        view = StoreView(spec.run, verify=settings.verify)
        planned = plan(nodes, view, spec.seed, Selection(frozenset({name}), settings.selection.forced))
        check_inputs(spec, nodes, planned)
        decision = planned.of(name)
        taken = [d.record for d in planned.decisions if d.record is not None and d.stage in node.inputs.values()]
        _compare_with_use(spec, nodes, taken, name, listener)
        store.prepare(spec.run)
        if not _has_overview(spec):
            with on_disk(spec.run):
                overview = overview_of(spec, nodes, settings.request)
                store.write_json({**overview, "status": "stage by stage"}, spec.run, "run.json")
        if decision.record is not None:
            if not store.is_current(spec.run, decision.record):
                store.make_current(spec.run, decision.record)
            _compare_with_use(spec, nodes, [decision.record], "", listener)
            return dict(decision.record), False
        above = {d.stage: d.record for d in planned.decisions if d.record is not None}
        listener.started(name, node.method.name, 1, 1)
        with pool(1, lambda stage, event, *about: getattr(listener, event)(stage, *about)) as workers:
            outcome = workers.submit(task_of(spec, node, decision, above, settings.source)).result()
        if outcome.record is None:
            listener.failed(name, spec.run / "failed" / name)
            outcome.raise_error()
        record = outcome.record or {}
        store.make_current(spec.run, record)
        listener.finished(record)
        _compare_with_use(spec, nodes, [record], "", listener)
        return record, True


def _has_overview(spec: Spec) -> bool:
    """Whether there is a run.json that is whole."""
    try:
        return store.read_overview(spec.run) is not None
    except ArtifactError:
        return False


def _compare_with_use(
    spec: Spec, nodes: tuple[StageNode, ...], records: Iterable[Mapping[str, Any]], of: str, listener: Listener
) -> None:
    """Refuse to go on from results that offer what no stage of the pipeline uses."""
    not_used = unused(nodes, records, spec.ignore, of)
    for stage, message in not_used.warnings:
        listener.warned(stage, message)
    raise_all(not_used.errors)
