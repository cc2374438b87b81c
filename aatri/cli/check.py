"""`aatri check`: what a run would refuse, before it runs."""

from __future__ import annotations

import functools
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_run
from aatri.cli.arguments.options import AsJson, Into, LocalPlugins, Methods, Settings, Variant
from aatri.cli.block_reading import block_reading
from aatri.cli.terminal.console import report_error, reports_errors, say, say_json, say_table
from aatri.errors import AatriError, Errors, ResourceError
from aatri.ids import amounts

if TYPE_CHECKING:
    from aatri.cli.arguments.planning import Request
    from aatri.pipeline.plan.graph import StageNode
    from aatri.pipeline.spec.pipeline_file import Spec

    _Wired = tuple[Spec, tuple[StageNode, ...]]

BYTES_EACH = 30_000
BYTES_PER_IMAGE_POINT = {"ImagePoints": 55, "Models": 85, "Strips": 85, "Solution": 125, "Evaluation": 15}
"""Room of a result by its kind, one is kept of each stage: measured at the demo (255 film images, 18,045 image points,
3,704 points) and a block of 63 image points; without tests and covariances of points, which are asked for."""


@dataclass
class _Check:
    """One thing that a run asks for."""

    name: str
    """What was looked at."""
    detail: str = ""
    """What there is."""
    error: AatriError | None = None
    """What a run would refuse."""
    warnings: list[str] = field(default_factory=list)
    """What a run would warn of."""

    def plain(self) -> dict[str, Any]:
        """As JSON takes it."""
        errors = self.error.errors if isinstance(self.error, Errors) else (self.error,) if self.error else ()
        faults = [{"what": e.what, "where": e.where, "remedy": e.remedy, "exit_code": e.exit_code} for e in errors]
        return {"check": self.name, "detail": self.detail, "errors": faults, "warnings": self.warnings}


@reports_errors
def check(
    project: Annotated[
        Path, typer.Argument(autocompletion=complete_run, help="The folder of a project, or a pipeline file.")
    ] = Path(),
    into: Into = None,
    set_: Settings = None,
    use: Methods = None,
    variant: Variant = "",
    local_plugins: LocalPlugins = False,
    json: AsJson = False,
) -> None:
    """Say what a run would refuse, before it runs: pipeline, options, variants, packages, block tables, disk, lock.

    The block is read, and compared with what the stages use and need. Nothing is written into the project. What only an
    adjustment can see, the run itself says. The exit code is that of the first error.
    """
    from aatri.cli.arguments.locate import DEFAULT, project_file
    from aatri.cli.arguments.planning import Request
    from aatri.pipeline.run.workers import share_cores

    share_cores(1)
    path = project_file(project if project != Path() else DEFAULT)
    request = Request(str(path), str(into or ""), tuple(set_ or ()), tuple(use or ()), variant, local_plugins)
    checks = list(_checks(request))
    errors = [one.error for one in checks if one.error is not None]
    if json:
        say_json({"pipeline": str(path), "ok": not errors, "checks": [one.plain() for one in checks]})
    else:
        say_table(("check", "", ""), [[c.name, "refused" if c.error else "ok", c.detail] for c in checks])
        say()
        for text in (text for one in checks for text in one.warnings):
            say(f"warning: {text}")
        for error in errors:
            report_error(error)
        say("a run would be refused" if errors else "nothing that a run would refuse")
    if errors:
        raise typer.Exit(errors[0].exit_code)


def _checks(request: Request) -> Iterator[_Check]:
    """Every check that can be made; a later one needs what an earlier one has read."""
    from aatri.cli.arguments.planning import read_request
    from aatri.pipeline.methods.compile_kernels import without_compiler

    spec, local = read_request(request)
    planned, wired, in_order = without_compiler(_planned, spec, request, local)
    yield from planned
    made: list[Mapping[str, Any]] = []
    if wired is not None:
        block, made = _read(wired[0], wired[1], local)
        block.warnings += _without_start(wired[1], {record["stage"]: record["metrics"] for record in made})
        yield block
    done = wired is not None and in_order and _is_done(*wired)
    disk = _Check("disk", "nothing to write: all stages are up to date")
    yield disk if done else _disk(spec, wired[1] if wired is not None else (), made)
    yield _tried("lock", lambda: _lock(spec.run, done=done))[1]


def _planned(spec: Spec, request: Request, local: Path | None) -> tuple[list[_Check], _Wired | None, bool]:
    """The checks that import stages; the wired pipeline, at least what reads the block; and whether it is all of it."""
    wired, pipeline = _tried("pipeline", lambda: _wired(spec, request, local))
    if wired is not None:
        pipeline.detail = amounts({"stages": len(wired[1])})
    checks = [pipeline]
    if spec.variants and not request.variant:
        checks.append(_variants(spec, request, local))
    if wired is not None:
        return [*checks, _tried("packages", lambda: _import(wired[1], local))[1]], wired, True
    bare = replace(spec, stages=spec.sources, gates={})
    return checks, _tried("", lambda: _wired(bare, replace(request, set_=(), use=()), local))[0], False


def _tried(name: str, call: Callable[[], Any]) -> tuple[Any, _Check]:
    """What a call gives, or None with what it refuses."""
    try:
        return call(), _Check(name)
    except AatriError as error:
        return None, _Check(name, error=error)


def _wired(spec: Spec, request: Request, local: Path | None) -> _Wired:
    from aatri.cli.arguments.planning import wired
    from aatri.pipeline.methods.catalogue import Catalogue

    return wired(spec, request, Catalogue(local, runs_code=request.local_plugins))[:2]


def _variants(spec: Spec, request: Request, local: Path | None) -> _Check:
    """Every variant of the file, wired."""
    from aatri.pipeline.spec.overrides import with_variant

    one = _Check("variants", ", ".join(spec.variants))
    errors: list[AatriError] = []
    for name in spec.variants:
        _, outcome = _tried(name, functools.partial(_wired, with_variant(spec, name), request, local))
        if outcome.error is not None:
            errors += outcome.error.errors if isinstance(outcome.error, Errors) else (outcome.error,)
    one.error = Errors(errors) if errors else None
    return one


def _import(nodes: tuple[StageNode, ...], local: Path | None) -> None:
    """Import every stage: a package that is missing shows here."""
    from aatri.pipeline.methods.registry import find_stages

    registry = find_stages(local) if local is not None else find_stages()
    for node in nodes:
        registry.card(node.method.name)


def _read(spec: Spec, nodes: tuple[StageNode, ...], local: Path | None) -> tuple[_Check, list[Mapping[str, Any]]]:
    """Read the block, and compare it with what the stages use and need; gives the records of what was read, too."""
    reading = block_reading(spec, nodes, local)
    figures = [reading.records[name]["metrics"] for name in sorted(spec.sources) if name in reading.records]
    names = ("images", "points", "image_points", "control_points", "check_points")
    detail = "; ".join(amounts({name: of_block.get(name) for name in names}) for of_block in figures)
    return _Check("block", detail, reading.error, reading.warnings), list(reading.records.values())


def _without_start(nodes: tuple[StageNode, ...], figures: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Bundles that begin with the orientations of a block that has none."""
    bare = {
        name for name, figure in figures.items() if figure.get("images") and figure.get("exterior_observations") == 0
    }
    return [
        f"{node.name}: no start values: {node.inputs['block']} has neither orientations nor positions of images, and "
        "the stage has no `initial`: images that show fewer than four control points will be left out; put "
        "initial_orientation/graph before it, and `initial` into its `from`"
        for node in nodes
        if node.method.name.startswith("bundle_adjustment/")
        and node.inputs.get("block") in bare
        and "image_points" in node.inputs
        and "initial" not in node.inputs
    ]


def _disk(spec: Spec, nodes: tuple[StageNode, ...], read: list[Mapping[str, Any]]) -> _Check:
    """Whether the results may be written, and have room."""
    there = next(folder for folder in (spec.run, *spec.run.absolute().parents) if folder.exists())
    image_points = sum(int(record["metrics"].get("image_points") or 0) for record in read)
    results = (BYTES_EACH + BYTES_PER_IMAGE_POINT.get(node.method.kind, 0) * image_points for node in nodes)
    free, need = shutil.disk_usage(there).free, sum(int(r["output"]["size"]) for r in read) + sum(results)
    one = _Check("disk", f"{free / 1e9:.1f} GB free, about {max(need, 1e6) / 1e6:.0f} MB needed")
    if not os.access(there, os.W_OK):
        one.error = ResourceError("may not be written", where=str(there), remedy="another folder: --into DIR")
    elif free < need:  # a forecast: the run itself tries
        one.warnings.append(
            f"{there}: {free / 1e6:.0f} MB are free, about {need / 1e6:.0f} MB may be needed: --into DIR"
        )
    return one


def _is_done(spec: Spec, nodes: tuple[StageNode, ...]) -> bool:
    """Whether a run would find nothing to do, which it may on a disk that it cannot write."""
    from aatri.pipeline.plan.decisions import Selection
    from aatri.pipeline.plan.view import StoreView
    from aatri.pipeline.run.overview import finished

    return finished(spec, nodes, lambda *_: None, Selection(), StoreView(spec.run)) is not None


def _lock(run: Path, *, done: bool) -> None:
    """See that no other run is at work in the folder; in one that is done it may be that nobody can."""
    from aatri.pipeline.run.overview import cannot_be_written
    from aatri.pipeline.store.lock import locked

    if not run.is_dir():
        return
    try:
        with locked(run, "aatri check"):
            pass
    except ResourceError as error:
        if not (done and cannot_be_written(error)):
            raise
