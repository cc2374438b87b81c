"""One stage to be made, as names and paths: what a worker process gets, wherever it runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri import errors
from aatri.errors import AatriError, Errors, raise_all
from aatri.pipeline.plan.decisions import Decision
from aatri.pipeline.plan.graph import StageNode

if TYPE_CHECKING:
    from aatri.pipeline.spec.pipeline_file import Spec

STAGES = "aatri.pipeline.methods.registry:find_stages"


@dataclass(frozen=True)
class StageSource:
    """Where stages come from: the function that finds them, as `module:function`, and a project's own folder.

    `runs_code` says that options may name Python of the project.
    """

    finder: str = STAGES
    local: Path | None = None
    runs_code: bool = False


@dataclass(frozen=True)
class Task:
    """A stage to be made."""

    run: Path
    stage: str
    use: str
    version: int
    written: Mapping[str, Any]
    options: Mapping[str, Any]
    """Options as written, to be validated again, and with defaults, for the record."""
    base: Path
    """Folder that relative paths refer to."""
    inputs: Mapping[str, Mapping[str, Any]]
    """Port -> record of the artifact."""
    key: str
    parts: Mapping[str, Any]
    """What the key is made of."""
    seed: int
    source: StageSource = StageSource()


@dataclass(frozen=True)
class TaskOutcome:
    """What came of a task: the record of the result, or what went wrong as (class, what, where, remedy)."""

    record: dict[str, Any] | None = None
    errors: tuple[tuple[str, str, str, str], ...] = ()

    def raise_error(self) -> None:
        """Raise what went wrong, if anything did."""
        raise_all(
            [getattr(errors, name)(what, where=where, remedy=remedy) for name, what, where, remedy in self.errors]
        )


def task_of(
    spec: Spec, node: StageNode, decision: Decision, records: Mapping[str, Mapping[str, Any]], source: StageSource
) -> Task:
    """The task of a stage that is to run, with the records of the stages above it."""
    inputs = {port: records[stage] for port, stage in node.inputs.items()}
    return Task(
        spec.run,
        node.name,
        node.method.name,
        node.method.version,
        node.written,
        node.options,
        spec.base,
        inputs,
        decision.key or "",
        decision.parts,
        spec.seed,
        source,
    )


def failed(error: AatriError) -> TaskOutcome:
    """The outcome of a task that failed."""
    single = error.errors if isinstance(error, Errors) else (error,)
    return TaskOutcome(None, tuple((_of_tree(e), e.what, e.where, e.remedy) for e in single))


def _of_tree(error: AatriError) -> str:
    """The class of `aatri.errors` that an error belongs to: it can be made again from its texts, its subclasses not."""
    return next(str(cls.__name__) for cls in type(error).__mro__ if vars(errors).get(cls.__name__) is cls)
