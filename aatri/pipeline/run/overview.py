"""run.json: what a run says of its pipeline and of how it ended, and whether that is all a run would leave.

A run in which there is nothing to do needs no writing, so it may lie on a disk that nobody may write.

status   running, done, gate_failed (all is made, and a quality gate failed), failed, interrupted, stage by stage
gates    every gate that was judged, with the value it met
"""

import errno
import shlex
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from aatri.errors import ArtifactError
from aatri.pipeline.plan.decisions import Plan, Selection, plan
from aatri.pipeline.plan.graph import StageNode
from aatri.pipeline.plan.unused import Unused, unused
from aatri.pipeline.plan.view import StoreView
from aatri.pipeline.spec.gates import judge
from aatri.pipeline.spec.pipeline_file import Spec
from aatri.pipeline.store import inside
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.records import SCHEMA

DONE, GATE_FAILED = "done", "gate_failed"


def overview_of(spec: Spec, nodes: tuple[StageNode, ...], request: Mapping[str, Any]) -> dict[str, Any]:
    """What run.json says of a pipeline."""
    stages = [{"stage": n.name, "use": n.method.name, "from": dict(n.inputs), "kind": n.method.kind} for n in nodes]
    return {"schema": SCHEMA, "pipeline": str(spec.path), "seed": spec.seed, "request": dict(request), "stages": stages}


def is_settled(spec: Spec, nodes: tuple[StageNode, ...], planned: Plan, not_used: Unused, selection: Selection) -> bool:
    """Whether the run folder shows just the results that the plan finds fresh, and the verdicts of their gates."""
    if any(d.selected and (d.record is None or not store.is_current(spec.run, d.record)) for d in planned.decisions):
        return False
    if any(name.startswith(".tmp-") for name in inside.names_in(spec.run)):
        return False  # killed while its report was written
    try:
        shown = store.read_overview(spec.run) or {}
    except ArtifactError:
        return False  # it is written anew
    if shown.get("warnings", []) != plain_warnings(not_used.warnings):
        return False
    if shown.get("status") not in (DONE, GATE_FAILED) or shown.get("stages") != overview_of(spec, nodes, {})["stages"]:
        return False
    verdicts = judge(spec, [d.record for d in planned.decisions if d.record is not None], selection.stages)
    return bool(shown.get("gates", []) == [verdict.plain() for verdict in verdicts])


def plain_warnings(warnings: Iterable[tuple[str, str]]) -> list[dict[str, str]]:
    """Warnings as JSON takes them."""
    return [{"stage": stage, "message": message} for stage, message in warnings]


def cannot_be_written(error: BaseException) -> bool:
    """Whether an error comes of a disk or folder that may only be read."""
    cause = error.__cause__
    return isinstance(cause, OSError) and cause.errno in (errno.EROFS, errno.EACCES, errno.EPERM)


def finished(
    spec: Spec,
    nodes: tuple[StageNode, ...],
    warned: Callable[[str, str], None],
    selection: Selection,
    view: StoreView,
    planned: Plan | None = None,
) -> list[dict[str, Any]] | None:
    """The records of a run in which there is nothing to do; None if there is something."""
    planned = planned or plan(nodes, view, spec.seed, selection)
    if planned.stale:
        return None
    records = [d.record for d in planned.decisions if d.record is not None]
    not_used = unused(nodes, records, spec.ignore)
    if not_used.errors or not is_settled(spec, nodes, planned, not_used, selection):
        return None
    for stage, message in not_used.warnings:
        warned(stage, message)
    return [dict(record) for record in records]


def arguments_of(request: Mapping[str, Any]) -> list[str]:
    """The arguments beside the pipeline file: `--into --set --use --variant --local-plugins`."""
    arguments = ["--into", str(request["into"])] if request.get("into") else []
    arguments += [part for text in request.get("set_") or () for part in ("--set", str(text))]
    arguments += [part for text in request.get("use") or () for part in ("--use", str(text))]
    arguments += ["--variant", str(request["variant"])] if request.get("variant") else []
    return [*arguments, *(["--local-plugins"] if request.get("local_plugins") else [])]


def command_of(overview: Mapping[str, Any]) -> str:
    """`aatri run PIPELINE ...` of a run.json, quoted for a shell."""
    request = overview.get("request") or {}
    pipeline = str(request.get("pipeline") or overview.get("pipeline") or "pipeline.yaml")
    return shlex.join(["aatri", "run", pipeline, *arguments_of(request)])
