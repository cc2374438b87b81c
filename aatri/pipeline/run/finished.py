"""A run in which there is nothing to do: it needs no writing, so it may lie on a disk that nobody may write."""

import errno
from collections.abc import Callable
from typing import Any

from aatri.pipeline.plan.decisions import Plan, Selection, plan
from aatri.pipeline.plan.graph import StageNode
from aatri.pipeline.plan.unused import unused
from aatri.pipeline.plan.view import StoreView
from aatri.pipeline.run.overview import is_settled
from aatri.pipeline.spec.pipeline_file import Spec


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
    known = [d.record for d in planned.decisions if d.record is not None]
    found = unused(nodes, known, spec.ignore)
    if found.errors or not is_settled(spec, nodes, planned, found, selection):
        return None
    for stage, message in found.warnings:
        warned(stage, message)
    return [dict(record) for record in known]
