"""Runs of aatri for the campaigns, and what must hold of a run folder whatever happened to it.

Runs are forked from a process that has imported everything already, so that a campaign of a thousand runs takes
minutes; what they skip, the start of Python and its imports, writes nothing into a run. Results are read here from the
files of the store by json and hashlib alone: the code under test does not judge itself.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TextIO, TypeVar

from tests.campaigns import made_up

Item = TypeVar("Item")

STAGES = 11
PIPELINE = """\
run: run
seed: 1
stages:
  block:       {use: block/simulate, with: {preset: rc30, flight: {strips: 3, images_per_strip: 5, cross_strips: 0},
                ties: {new_points: 180}, known: {full: 10, check_full: 4}}}
"""
CHAIN = """\
  interior:    {use: interior_orientation/affine, from: {block}}
  refined:     {use: image_refinement/systematic, from: {block, image_points: interior}}
  models:      {use: relative_orientation/dependent, from: {block, image_points: refined}}
  strips:      {use: strip_formation/scale_transfer, from: {block, models}}
  absolute:    {use: absolute_orientation/similarity, from: {block, strips, image_points: refined}}
  strip_block: {use: strip_adjustment/polynomial,
                from: {block, image_points: refined, strips, models, initial: absolute}}
  bundle:      {use: bundle_adjustment/bundle, from: {block, image_points: refined, initial: strip_block},
                with: {interior_unknowns: true}}
  accuracy_absolute:    {use: accuracy/evaluation, from: {block, solution: absolute}}
  accuracy_strip_block: {use: accuracy/evaluation, from: {block, solution: strip_block}}
  accuracy:             {use: accuracy/evaluation, from: {block, solution: bundle}}
"""


@dataclass(frozen=True)
class Child:
    """A run under way; `output` is the file that takes what it prints."""

    pid: int
    output: Path

    def is_alive(self) -> bool:
        return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None

    def kill(self, number: int = signal.SIGKILL) -> None:
        os.kill(self.pid, number)

    def wait(self) -> int:
        """The exit code, or minus the signal that ended it."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def text(self) -> str:
        return self.output.read_text(errors="replace")


def start(
    arguments: Sequence[str | Path], output: Path, *, before: Callable[[], Any] = int, after: Callable[[], Any] = int
) -> Child:
    """Begin `aatri ARGUMENTS` in a forked process; `before` and `after` are called in it."""
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        _become_aatri([str(a) for a in arguments], output, before, after)
    return Child(pid, output)


def run(arguments: Sequence[str | Path], output: Path, **hooks: Callable[[], Any]) -> int:
    """Carry out `aatri ARGUMENTS` in a forked process; its exit code."""
    return start(arguments, output, **hooks).wait()


def _become_aatri(arguments: list[str], output: Path, before: Callable[[], Any], after: Callable[[], Any]) -> NoReturn:
    code: Any = 70
    try:
        handle = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(handle, 1)
        os.dup2(handle, 2)
        sys.argv = ["aatri", *arguments]
        before()
        from aatri.cli.main import main

        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code or 0
        except KeyboardInterrupt:  # before the verb began
            code = 130
        after()
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(code if isinstance(code, int) else 1)


def write_pipeline(folder: Path, block: str = PIPELINE) -> Path:
    """The pipeline of a small simulated block, or with other first lines."""
    path = folder / "pipeline.yaml"
    path.write_text(block + CHAIN)
    return path


@dataclass(frozen=True)
class Subject:
    """What is run: a pipeline, and options that all its runs need."""

    pipeline: Path
    options: tuple[str, ...] = ()

    def into(self, folder: Path, *more: str) -> list[str | Path]:
        """The command of a run in a folder."""
        return ["run", self.pipeline, "-q", *self.options, "--into", folder, *more]


def subject(folder: Path, given: argparse.Namespace, *options: str) -> Subject:
    """The small block, or the made-up stages."""
    if given.made_up:
        return Subject(made_up.write_project(folder), ("--local-plugins", *options))
    return Subject(write_pipeline(folder), options)


def undisturbed(folder: Path, subject: Subject) -> tuple[dict[str, str], float]:
    """Digests of a run that nothing disturbs, and the seconds it took; warms this process up."""
    output, about = folder / "undisturbed.txt", folder / "modules.json"

    def tell() -> None:
        names = sorted(name for name in sys.modules if name.startswith("aatri."))
        about.write_text(json.dumps([names, os.environ["NUMBA_CACHE_DIR"]]))

    assert run(subject.into(folder / "first"), output, after=tell) == 0, output
    names, os.environ["NUMBA_CACHE_DIR"] = json.loads(about.read_text())
    for name in (name for name in names if not name.startswith("aatri_project")):
        importlib.import_module(name)
    begin = time.monotonic()
    assert run(subject.into(folder / "undisturbed"), output) == 0, output
    seconds = time.monotonic() - begin
    digests = {stage: record["output"]["content_digest"] for stage, record in current(folder / "undisturbed").items()}
    assert problems(folder / "undisturbed") == []
    assert len(digests) == STAGES
    return digests, seconds


def current(folder: Path) -> dict[str, dict[str, Any]]:
    """The current records by stage."""
    return {path.stem: json.loads(path.read_bytes()) for path in sorted((folder / "current").glob("[!.]*.json"))}


def digests_of(folder: Path) -> dict[str, str]:
    """Content digests of the current results."""
    return {stage: record["output"]["content_digest"] for stage, record in current(folder).items()}


def problems(folder: Path, *, leftovers: bool = True) -> list[str]:
    """What is wrong in a run folder: a record whose artifact is not whole, a link elsewhere, a file half-written."""
    found = []
    for path in [*(folder / "current").glob("[!.]*.json"), *folder.glob("objects/*/*/record.json")]:
        try:
            record = json.loads(path.read_bytes())
            place = folder / "objects" / record["stage"] / record["key"] / record["output"]["file"]
            if _sha256(place) != record["output"]["sha256"]:
                found.append(f"{path}: its artifact is not whole")
            if path.parent.name == "current" and _sha256(path.with_suffix(".h5")) != record["output"]["sha256"]:
                found.append(f"{path}: the link leads elsewhere")
        except (OSError, ValueError, KeyError) as error:
            found.append(f"{path}: {type(error).__name__}: {error}")
    if leftovers:
        found += [f"left: {path}" for path in folder.rglob(".tmp-*")]
    return found


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def new_folder() -> Path:
    """A temporary folder."""
    return Path(tempfile.mkdtemp(prefix="campaign-")).resolve()


@contextlib.contextmanager
def workplace() -> Iterator[Path]:
    """A temporary folder with caches of its own; compiled code is shared, and what is known of the code copied."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "aatri"
    os.environ.setdefault("NUMBA_CACHE_DIR", str(cache / "numba"))
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    place = new_folder()
    (place / "cache" / "aatri").mkdir(parents=True)
    for codes in cache.glob("codes-*.json"):
        shutil.copy(codes, place / "cache" / "aatri")
    os.environ["XDG_CACHE_HOME"] = str(place / "cache")
    yield place
    shutil.rmtree(place)  # kept if the campaign breaks off


def without_report() -> None:
    """A hook: runs write no report, which takes as long as all stages of a small block."""
    from aatri.cli import run as verb

    verb._write_report = lambda *_args, **_rest: None  # type: ignore[assignment]


def arguments(doc: str | None, what: str, count: Callable[[str], Any] = int) -> argparse.ArgumentParser:
    """The command line of a campaign: its count, the seed of its random choices, processes side by side."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=count, help=what)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1, help="rounds side by side")
    parser.add_argument("--made-up", action="store_true", help="eleven small stages instead of a block")
    return parser


def carry_out(one: Callable[[Item], dict[str, int]], items: Sequence[Item], workers: int) -> dict[str, int]:
    """Do all rounds, shared out among forked processes; the sums of what they count."""
    total: dict[str, int] = {}
    pipes = [_share(one, items[k::workers]) for k in range(workers)] if workers > 1 else []
    for counted in (json.loads(line) for pipe in pipes for line in pipe) if pipes else map(one, items):
        for name, number in counted.items():
            total[name] = total.get(name, 0) + number
    for pipe in pipes:
        pipe.close()
        os.wait()
    return dict(sorted(total.items()))


def _share(one: Callable[[Item], dict[str, int]], items: Sequence[Item]) -> TextIO:
    """Begin a part of the rounds in a forked process; a line of JSON comes for each."""
    reader, writer = os.pipe()
    if os.fork() == 0:
        try:
            for item in items:
                try:
                    counted = one(item)
                except Exception:
                    traceback.print_exc()
                    counted = {"WRONG rounds": 1}
                os.write(writer, (json.dumps(counted) + "\n").encode())
        finally:
            os._exit(0)
    os.close(writer)
    return os.fdopen(reader)


def conclude(title: str, counted: dict[str, int], begin: float) -> None:
    """Print what was counted; the campaign has failed if any of it is named `WRONG ...`."""
    figures = ", ".join(f"{number} {name}" for name, number in counted.items())
    sys.stdout.write(f"{title}: {figures}; {time.monotonic() - begin:.0f} s\n")
    if any(name.startswith("WRONG") for name in counted):
        sys.exit(1)
