"""Runs of made-up stages for the tests of the store and the runner."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aatri.pipeline.methods.catalogue import Catalogue
from aatri.pipeline.plan.decisions import Plan, plan, select
from aatri.pipeline.plan.graph import StageNode, wire
from aatri.pipeline.plan.view import StoreView
from aatri.pipeline.run.runner import RunSettings, run_pipeline
from aatri.pipeline.run.task import StageSource
from aatri.pipeline.spec.overrides import with_set, with_use, with_variant
from aatri.pipeline.spec.pipeline_file import Spec, load_spec
from aatri.pipeline.store.objects import commit_object
from aatri.pipeline.store.run_folder import make_current
from aatri.tables.schema import Artifact
from tests.made_up_stages import made_up_registry

SOURCE = StageSource("tests.made_up_stages:made_up_registry")


class Quiet:
    """A listener that remembers which stages were begun."""

    def __init__(self) -> None:
        self.begun: list[str] = []

    def planned(self, plan: Plan, expected: Mapping[str, float]) -> None:
        pass

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        self.begun.append(stage)

    def logged(self, stage: str, message: str) -> None:
        pass

    def warned(self, stage: str, message: str) -> None:
        pass

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        pass

    def finished(self, record: Mapping[str, Any]) -> None:
        pass

    def failed(self, stage: str, folder: Path) -> None:
        pass


def opened(
    path: Path, *, sets: tuple[str, ...] = (), uses: tuple[str, ...] = (), variant: str = ""
) -> tuple[Spec, tuple[StageNode, ...]]:
    """The pipeline of a file, wired."""
    catalogue = Catalogue(registry=made_up_registry())
    spec = load_spec(path)
    spec = with_variant(spec, variant) if variant else spec
    spec, _ = with_use(spec, uses, catalogue)
    spec = with_set(spec, sets)
    return spec, wire(spec, catalogue)


def planned(path: Path, **changes: Any) -> Plan:
    """What a run would do."""
    spec, nodes = opened(path, **changes)
    return plan(nodes, StoreView(spec.run, verify=True), spec.seed)


def run(
    path: Path, how: Mapping[str, Any] | None = None, **changes: Any
) -> tuple[list[str], dict[str, dict[str, Any]]]:
    """Run; the stages that were made, and all records."""
    spec, nodes = opened(path, **changes)
    given = dict(how or {})
    selection = select(nodes, **given.pop("select", {}))
    listener = Quiet()
    records = run_pipeline(spec, nodes, listener, RunSettings(selection, source=SOURCE, **given))
    return listener.begun, {record["stage"]: record for record in records}


def bare_record() -> dict[str, Any]:
    """What a record holds beside its stage, key and output, of a stage without inputs, options and figures."""
    time = "2026-01-01T00:00:00+00:00"
    parts = {
        "plugin": "x/y",
        "version": 1,
        "options": {},
        "files": {},
        "inputs": {},
        "code": "",
        "schemas": {},
        "seed": None,
    }
    return {
        "plugin": "x/y",
        "version": 1,
        "options": {},
        "inputs": {},
        "parts": parts,
        "metrics": {},
        "warnings": [],
        "started": time,
        "ended": time,
        "seconds": 1.5,
        "seed": None,
        "environment": {},
    }


def digests(records: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Content digests by stage."""
    return {stage: record["output"]["content_digest"] for stage, record in records.items()}


def read_events(run: Path) -> list[dict[str, Any]]:
    """The events of a run, without a last line that was not finished."""
    events = []
    for line in (run / "events.jsonl").read_text(encoding="utf-8", errors="replace").splitlines():
        with contextlib.suppress(ValueError):
            events.append(json.loads(line))
    return events


def commit(run: Path, stage: str, key: str, artifact: Artifact, record: Mapping[str, Any]) -> dict[str, Any]:
    """Bring an artifact and its record to the disk and make it the current one, as a run does; returns the record."""
    full = commit_object(run, stage, key, artifact, record)
    make_current(run, full)
    return full
