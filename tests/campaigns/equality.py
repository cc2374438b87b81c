"""Run the small block in every way a run can be started: the content digests must be equal.

    python -m tests.campaigns.equality 9

The ways, of which the first so many are tried: two jobs; a process of its own; two jobs with forked instead of spawned
workers; another seed of Python's hashes; one thread for compiled kernels; stage by stage through `aatri exec`; a wheel,
unpacked elsewhere; the wheel with two jobs; another folder and time zone.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

from tests.campaigns import harness

ROOT = Path(__file__).resolve().parents[2]
MAIN = "from aatri.cli.main import main; main()"


def main() -> None:
    given, begin = harness.arguments(__doc__, "ways").parse_args(), time.monotonic()
    counted: dict[str, int] = {}
    with harness.workplace() as place:
        pipeline = harness.write_pipeline(place)
        expected, _ = harness.undisturbed(place, harness.Subject(pipeline))
        for number, way in enumerate(WAYS[: given.count]):
            folder = place / f"way-{number}"
            way(pipeline, folder)
            assert harness.problems(folder) == []
            is_equal = harness.digests_of(folder) == expected
            name = "equal" if is_equal else f"WRONG {way.__name__}"
            counted[name] = counted.get(name, 0) + 1
    harness.conclude("equality", counted, begin)


def own_process(pipeline: Path, folder: Path, *more: str, tree: Path = ROOT, **environment: str) -> None:
    """A process of its own; of another tree it must not see this one."""
    command = [sys.executable, "-c", f"import aatri; assert {str(tree)!r} in aatri.__file__, aatri.__file__; {MAIN}"]
    command += ["run", str(pipeline), "-q", "--into", str(folder), *more]
    done = subprocess.run(
        command,
        cwd=pipeline.parent,
        env={**os.environ, "PYTHONPATH": str(tree), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def two_jobs(pipeline: Path, folder: Path) -> None:
    """Two spawned workers."""
    own_process(pipeline, folder, "--jobs", "2")


def forked_workers(pipeline: Path, folder: Path) -> None:
    """Two forked workers."""
    begin = multiprocessing.get_context

    def fork() -> None:
        multiprocessing.get_context = lambda method=None: begin("fork")  # type: ignore[assignment,misc]

    command = ["run", pipeline, "-q", "--into", folder, "--jobs", "2"]
    output = pipeline.parent / "forked.txt"
    assert harness.run(command, output, before=fork) == 0, output.read_text()


def other_hash_seed(pipeline: Path, folder: Path) -> None:
    """Other order of sets."""
    own_process(pipeline, folder, PYTHONHASHSEED="4711")


def one_thread(pipeline: Path, folder: Path) -> None:
    """Compiled kernels with one thread."""
    own_process(pipeline, folder, NUMBA_NUM_THREADS="1")


def stage_by_stage(pipeline: Path, folder: Path) -> None:
    """As an outside scheduler does it."""
    for line in pipeline.read_text().splitlines():
        if line.startswith("  ") and "{use:" in line:
            command = ["exec", pipeline, line.split(":")[0].strip(), "--into", folder]
            output = pipeline.parent / "exec.txt"
            assert harness.run(command, output) == 0, output.read_text()


def wheel(pipeline: Path, folder: Path, *more: str) -> None:
    """A wheel of this tree, unpacked."""
    tree = pipeline.parent / "unpacked"
    if not tree.exists():
        assert importlib.util.find_spec("hatchling"), "needs hatchling"
        command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(pipeline.parent)]
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
        (archive,) = pipeline.parent.glob("*.whl")
        zipfile.ZipFile(archive).extractall(tree)
    own_process(pipeline, folder, *more, tree=tree)


def wheel_two_jobs(pipeline: Path, folder: Path) -> None:
    """The wheel with two spawned workers."""
    wheel(pipeline, folder, "--jobs", "2")


def elsewhere(pipeline: Path, folder: Path) -> None:
    """Another folder, time zone and locale."""
    other = pipeline.parent / "a folder" / "elsewhere.yaml"
    other.parent.mkdir()
    other.write_text(pipeline.read_text())
    own_process(other, folder, TZ="Pacific/Apia", LC_ALL="C", LANG="de_DE.UTF-8")


WAYS = (
    two_jobs,
    own_process,
    forked_workers,
    other_hash_seed,
    one_thread,
    stage_by_stage,
    wheel,
    wheel_two_jobs,
    elsewhere,
)

if __name__ == "__main__":
    main()
