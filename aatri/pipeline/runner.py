"""Runs the stages one after the other, in this process, each in full.

Every stage gets its inputs, options, context and random numbers only where its signature asks for them. The generator
of a stage is seeded by the run's seed and the stage's name, so that adding a stage changes no other's numbers.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import time
import traceback
import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, TextIO

import numpy as np

from aatri.errors import AatriError, PluginError, ResourceError
from aatri.pipeline import store
from aatri.pipeline.graph import Node
from aatri.pipeline.provenance import environment, now
from aatri.pipeline.spec import Spec
from aatri.tables.schema import Artifact

KEY_SCHEMA = 1
_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM)


class Listener(Protocol):
    """Is told what happens during a run."""

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        """Take that a stage begins."""

    def warned(self, stage: str, message: str) -> None:
        """Take a warning of a stage."""

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Take how far a stage is."""

    def finished(self, record: Mapping[str, Any]) -> None:
        """Take the record of a stage that is done."""

    def failed(self, stage: str, folder: Path) -> None:
        """Take that a stage failed, and where its log lies."""


def run_pipeline(spec: Spec, nodes: tuple[Node, ...], listener: Listener) -> list[dict[str, Any]]:
    """Run all stages; returns their records in order.

    Raises
    ------
    AatriError
        The error of the first stage that fails. What was made before it stays.
    """
    overview = {
        "pipeline": str(spec.path),
        "seed": spec.seed,
        "started": now(),
        "stages": [_described(n) for n in nodes],
    }
    store.begin(spec.run, {**overview, "status": "running"})
    status, records, made = "interrupted", [], _Made(nodes)
    try:
        for number, node in enumerate(nodes, 1):
            listener.started(node.name, node.card.name, number, len(nodes))
            record, artifact = _run_stage(spec, node, made, listener)
            made.keep(node.name, artifact, record["output"]["content_digest"])
            records.append(record)
            listener.finished(record)
        status = "done"
    except AatriError:
        status = "failed"
        raise
    finally:
        store.write_json(spec.run / "run.json", {"schema": store.SCHEMA, **overview, "status": status, "ended": now()})
    return records


def stage_key(node: Node, digests: Mapping[str, str], seed: int) -> str:
    """First 12 hex digits of the SHA-256 over all that the result of a stage depends on.

    Parameters
    ----------
    node : Node
    digests : mapping of port to content digest
    seed : int
        Counts only where the stage asks for random numbers.
    """
    parts = {
        "key_schema": KEY_SCHEMA,
        "stage": node.name,
        "plugin": node.card.name,
        "version": node.card.version,
        "options": _plain_options(node),
        "inputs": dict(digests),
        "seed": seed if node.card.wants_rng else None,
    }
    canonical = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:12]


class _Made:
    """Artifacts made in this run, each kept until its last user has run."""

    def __init__(self, nodes: tuple[Node, ...]) -> None:
        self._last_user = {source: node.name for node in nodes for source in node.inputs.values()}
        self._artifacts: dict[str, Artifact] = {}
        self.digests: dict[str, str] = {}

    def keep(self, stage: str, artifact: Artifact, digest: str) -> None:
        self.digests[stage] = digest
        self._artifacts[stage] = artifact
        for source in [s for s in self._artifacts if self._last_user.get(s, s) == stage]:
            del self._artifacts[source]

    def inputs(self, node: Node) -> dict[str, Artifact]:
        return {port: self._artifacts[source] for port, source in node.inputs.items()}


def _run_stage(spec: Spec, node: Node, made: _Made, listener: Listener) -> tuple[dict[str, Any], Artifact]:
    digests = {port: made.digests[source] for port, source in node.inputs.items()}
    key = stage_key(node, digests, spec.seed)
    started, clock = now(), time.perf_counter()
    with (spec.run / "running" / f"{node.name}.log").open("w", encoding="utf-8") as log:
        context = _StageContext(node.name, listener, log, clock)
        try:
            artifact = _call(spec, node, made.inputs(node), context)
            metrics = {name: _plain(value) for name, value in artifact.metrics().items()}
        except Exception as error:
            told = _as_reported(error, node.name)
            log.write("".join(traceback.format_exception(error)) if told is not error else f"error: {error}\n")
            log.close()
            folder = store.fail(spec.run, node.name, _diagnostics(told, node, started))
            listener.failed(node.name, folder)
            if told is error:
                raise
            told.remedy = told.remedy or f"the log with the traceback is {folder / 'stage.log'}"
            raise told from error
    record = {
        "plugin": node.card.name,
        "version": node.card.version,
        "options": _plain_options(node),
        "inputs": {port: {"stage": node.inputs[port], "content_digest": digest} for port, digest in digests.items()},
        "seed": spec.seed if node.card.wants_rng else None,
        "status": "done",
        "metrics": metrics,
        "warnings": context.warnings,
        "started": started,
        "ended": now(),
        "seconds": round(time.perf_counter() - clock, 3),
        "environment": environment(),
    }
    try:
        return store.commit(spec.run, node.name, key, artifact, record), artifact
    except AatriError as error:
        listener.failed(node.name, store.fail(spec.run, node.name, _diagnostics(error, node, started)))
        raise


def _call(spec: Spec, node: Node, inputs: Mapping[str, Artifact], context: _StageContext) -> Artifact:
    extras: dict[str, Any] = {}
    if node.card.options is not None:
        extras["options"] = node.options
    if node.card.wants_context:
        extras["context"] = context
    if node.card.wants_rng:
        sequence = np.random.SeedSequence(spec.seed, spawn_key=(zlib.crc32(node.name.encode()),))
        extras["rng"] = np.random.default_rng(sequence)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_args, **_rest: context.log(f"{message}")
        artifact = node.card.function(**inputs, **extras)
    if not isinstance(artifact, node.card.kind):
        raise PluginError(f"returned a {type(artifact).__name__}, not a {node.card.kind.kind}", where=node.card.name)
    return artifact


class _StageContext:
    """What a stage talks to: everything goes to its log, warnings also to the record and the listener."""

    def __init__(self, stage: str, listener: Listener, log: TextIO, clock: float) -> None:
        self._stage, self._listener, self._file, self._clock = stage, listener, log, clock
        self.warnings: list[str] = []

    def log(self, message: str) -> None:
        """Write a line to the log, with the seconds since the start."""
        self._file.write(f"{time.perf_counter() - self._clock:9.3f}  {message}\n")
        self._file.flush()

    def warn(self, message: str) -> None:
        """Keep a warning."""
        self.warnings.append(message)
        self.log(f"warning: {message}")
        self._listener.warned(self._stage, message)

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Pass on how far the stage is."""
        self._listener.advanced(self._stage, done, total, what)


def _as_reported(error: Exception, stage: str) -> AatriError:
    """The error itself if it is ours; what the system lacks as ResourceError; anything else is a bug."""
    if isinstance(error, AatriError):
        return error
    if isinstance(error, MemoryError):
        return ResourceError(f"{stage} ran out of memory", remedy="a machine with more memory, or a smaller block")
    if isinstance(error, OSError) and error.errno in _DISK:
        return ResourceError(f"{stage}: {error.strerror}", where=str(error.filename or ""))
    return AatriError(f"internal error in {stage} (a bug): {type(error).__name__}: {error}")


def _diagnostics(error: AatriError, node: Node, started: str) -> dict[str, Any]:
    return {
        "plugin": node.card.name,
        "options": _plain_options(node),
        "status": "failed",
        "error": type(error).__name__,
        "exit_code": error.exit_code,
        "what": error.what,
        "where": error.where,
        "remedy": error.remedy,
        "started": started,
        "ended": now(),
    }


def _described(node: Node) -> dict[str, Any]:
    return {"stage": node.name, "use": node.card.name, "from": dict(node.inputs), "kind": node.card.kind.kind}


def _plain_options(node: Node) -> dict[str, Any]:
    return node.options.model_dump(mode="json") if node.options is not None else {}


def _plain(value: Any) -> float | int | None:
    """A metric as JSON takes it; NaN is *not determined*."""
    number: float | int | None = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(number, float) and not math.isfinite(number) else number
