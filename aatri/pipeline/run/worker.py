"""Makes one stage: reads its inputs, calls its method, and puts the result into the store.

It gets its inputs, options, context and random numbers only where the signature asks for them. The generator of a stage
is seeded by the run's seed and the stage's name, so that adding a stage changes no other's numbers. Which result is the
current one is not decided here: a worker only adds to the store, so that any scheduler may call it.
"""

import importlib
import json
import math
import sys
import time
import traceback
import warnings
import zlib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any, cast

import numpy as np

from aatri.errors import DISK, AatriError, PluginError, ResourceError, lacks_memory
from aatri.pipeline.methods.registry import Registry
from aatri.pipeline.run.context import LoggedContext, Tell, drop_checkpoints
from aatri.pipeline.run.task import Task, TaskOutcome, failed
from aatri.pipeline.store import inside
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.inside import on_disk, write_json
from aatri.pipeline.store.objects import commit_object, load_object
from aatri.pipeline.store.provenance import environment, now
from aatri.plugin import Options, StageCard
from aatri.progress import Workers
from aatri.tables.schema import Artifact


def perform(
    task: Task,
    tell: Tell,
    memory: dict[str, Artifact] | None = None,
    cluster: Callable[..., Workers] | None = None,
) -> TaskOutcome:
    """Make a stage.

    Parameters
    ----------
    tell : callable
        Takes the events of the stage.
    memory : dict, optional
        Artifacts of this process by content digest, used and added to.
    cluster : callable, optional
        Run and folder in it -> who works on parts of a stage.
    """
    started = now()
    running = task.run / "running"
    about = {"stage": task.stage, "key": task.key, "started": started}
    error: AatriError
    try:
        with on_disk(running):
            inside.make_folder(task.run, "running")
            write_json(about, task.run, "running", f"{task.stage}.json")
            log = inside.create(task.run, "running", f"{task.stage}.log")
        with on_disk(running), log:
            try:
                context = LoggedContext(log, tell, task.run, task.stage, task.key, cluster)
                artifact, record = _made(task, context, {} if memory is None else memory, started)
            except AatriError as problem:
                log.write(f"error: {problem}\n")
                raise
            except Exception as problem:
                log.write("".join(traceback.format_exception(problem)))
                raise _as_reported(problem, task.stage) from problem
        full = commit_object(task.run, task.stage, task.key, artifact, record)
        if memory is not None:
            memory[full["output"]["content_digest"]] = artifact
        drop_checkpoints(task.run, task.stage)
        with on_disk(running):
            inside.remove(task.run, "running", f"{task.stage}.json")
    except AatriError as problem:
        error = problem
    else:
        return TaskOutcome(full)
    return _failed(task, error, started)


def _failed(task: Task, error: AatriError, started: str) -> TaskOutcome:
    """Keep log and diagnostics apart; on a full disk not even that may be possible."""
    try:
        folder = store.fail(task.run, task.stage, _diagnostics(error, task, started))
        inside.remove(task.run, "running", f"{task.stage}.json")
        cause = error.__cause__
        if isinstance(cause, Exception) and not isinstance(cause, OSError) and not lacks_memory(cause):
            error.remedy = error.remedy or f"the log with the traceback is {folder / 'stage.log'}"
    except (AatriError, OSError):
        pass
    return failed(error)


def _made(
    task: Task, context: LoggedContext, memory: Mapping[str, Artifact], started: str
) -> tuple[Artifact, dict[str, Any]]:
    clock, processor = time.perf_counter(), time.process_time()
    card = _card(task)
    inputs = {port: _input(task, card, port, memory) for port in task.inputs}
    compilations = [(0.0, 0.0)]
    with _compilation_told(context, lambda *seconds: compilations.append(seconds)):
        artifact = _call(task, card, inputs, context)
    compile_s, compile_processor_s = map(sum, zip(*compilations))  # no later run compiles
    metrics = {name: _plain(value) for name, value in artifact.metrics().items()}
    record = {
        "plugin": task.use,
        "version": task.version,
        "options": dict(task.options),
        "inputs": {
            port: {"stage": source["stage"], "key": source["key"], "content_digest": source["output"]["content_digest"]}
            for port, source in task.inputs.items()
        },
        "seed": task.seed if card.wants_rng else None,
        "parts": dict(task.parts),
        "status": "done",
        "metrics": metrics,
        "warnings": context.warnings,
        "offers": [offer.plain() for offer in artifact.offers()],
        "started": started,
        "ended": now(),
        "seconds": round(time.perf_counter() - clock - compile_s, 3),
        "processor_seconds": round(time.process_time() - processor - compile_processor_s, 3),
        "environment": environment(),
    }
    return artifact, record


@cache
def _stages(find: Callable[[], Registry]) -> Registry:
    """All stages but those of a project: looked for once a process, not once a stage."""
    return find()


def _card(task: Task) -> StageCard:
    module, _, function = task.source.finder.partition(":")
    find = getattr(importlib.import_module(module), function)
    local = task.source.local
    registry = _stages(find) if local is None else find(local)
    if local is None and task.use not in registry.variants:
        registry = find()  # a package has been installed since
    card: StageCard = registry.card(task.use)
    return card


def _input(task: Task, card: StageCard, port: str, memory: Mapping[str, Artifact]) -> Artifact:
    record = task.inputs[port]
    kept = memory.get(record["output"]["content_digest"])
    if kept is not None:
        return kept
    kind = next(p.kind for p in card.ports if p.name == port)
    return load_object(task.run, record, kind)


def _call(task: Task, card: StageCard, inputs: Mapping[str, Artifact], context: LoggedContext) -> Artifact:
    extras: dict[str, Any] = {}
    if card.options is not None:
        extras["options"] = _options(task, card.options)
    if card.wants_context:
        extras["context"] = context
    if card.wants_rng:
        sequence = np.random.SeedSequence(task.seed, spawn_key=(zlib.crc32(task.stage.encode()),))
        extras["rng"] = np.random.default_rng(sequence)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_args, **_rest: context.log(f"{message}")
        artifact = card.function(**inputs, **extras)
    if not isinstance(artifact, card.kind):
        raise PluginError(f"returned a {type(artifact).__name__}, not a {card.kind.kind}", where=card.name)
    return artifact


def _compilation_told(context: LoggedContext, took: Callable[[float, float], None]) -> AbstractContextManager[object]:
    """Tell of kernels that are compiled within, and how long; a stage without kernels does not import the compiler."""
    if "numba" not in sys.modules:
        return nullcontext()
    from numba.core.event import install_listener

    from aatri.pipeline.methods.compile_listener import CompileListener

    listener = CompileListener(lambda text: context.progress(0, 0, text), took)
    return cast("AbstractContextManager[object]", install_listener("numba:compile", listener))


def _options(task: Task, model: type[Options]) -> Options:
    text = json.dumps(dict(task.written))
    return model.model_validate_json(text, strict=True, context={"base": task.base, "runs_code": task.source.runs_code})


def _as_reported(error: Exception, stage: str) -> AatriError:
    """What the system lacks as ResourceError; anything else is a bug."""
    if lacks_memory(error):
        return ResourceError(f"{stage} ran out of memory", remedy="a machine with more memory, or a smaller block")
    if isinstance(error, OSError) and error.errno in DISK:
        return ResourceError(f"{stage}: {error.strerror}", where=str(error.filename or ""))
    return AatriError(f"internal error in {stage} (a bug): {type(error).__name__}: {error}")


def _diagnostics(error: AatriError, task: Task, started: str) -> dict[str, Any]:
    return {
        "plugin": task.use,
        "key": task.key,
        "options": dict(task.options),
        "status": "failed",
        "error": type(error).__name__,
        "exit_code": error.exit_code,
        "what": error.what,
        "where": error.where,
        "remedy": error.remedy,
        "started": started,
        "ended": now(),
    }


def _plain(value: Any) -> float | int | None:
    """A metric as JSON takes it; NaN is *not determined*."""
    number: float | int | None = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(number, float) and not math.isfinite(number) else number
