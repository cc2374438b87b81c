"""The pipeline engine against Snakemake: the same eleven stages, nothing to do, one stage to do, everything to do.

    python -m venv peer && peer/bin/pip install snakemake
    python -m benchmarks.pipeline_against_snakemake --snakemake peer/bin/snakemake --repeats 7 [--bare]

What is compared. Eleven stages wired like the chain of the demo (`tests.campaigns.made_up.WIRING`); each adds the
numbers of its inputs and an option, and writes the sum, 100 numbers, to HDF5. For aatri they are stages of a project;
it also digests, checks and fsyncs what they write, and writes its report. For Snakemake they are a shell command that
starts a Python script with numpy and h5py. With `--bare` it gets the cheapest stages there are, a bare Python
(`-I -S`) that reads and writes text: less work than aatri's, a lower bound of the ratio.

    no-op         the same command again
    last          an option of the last stage has another value: one stage is made
    middle        an option of `strip_block` has another value: it and the three stages below it are made
    all           an empty folder

Each is run as a user runs it, a new process per run, alternately, one job at a time, with Snakemake's default triggers
(which notice changed parameters). Compiled bytecode is kept, as it is on a user's machine. The table gives medians of
the wall-clock times and their ratio.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.campaigns.made_up import WIRING, write_project

ADD = """\
import sys
output, offset, *inputs = sys.argv[1:]
total = [k + float(offset) for k in range(100)]
for name in inputs:
    with open(name) as file:
        total = [a + float(b) for a, b in zip(total, file)]
with open(output, "w") as file:
    file.writelines(f"{value!r}\\n" for value in total)
"""
ADD_HDF5 = """\
import sys
import h5py
import numpy as np
output, offset, *inputs = sys.argv[1:]
total = np.arange(100) + float(offset)
for name in inputs:
    with h5py.File(name) as file:
        total = total + file["values/value"][:]
with h5py.File(output, "w") as file:
    file["values/value"] = total
"""
RULE = """\
rule {stage}:
    input: {inputs}
    output: "out/{stage}.txt"
    params: offset=config["{stage}"]
    shell: "{python} add.py {{output}} {{params.offset}} {{input}}"

"""
MAIN = "from aatri.cli.main import main; main()"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--snakemake", default="snakemake", help="its command")
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--bare", action="store_true", help="Snakemake's stages write text, by Python alone")
    given = parser.parse_args()
    snakemake = shutil.which(given.snakemake) or sys.exit(f"no {given.snakemake}: see the top of this file")
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        runs = {
            "aatri": _aatri(place / "aatri"),
            "snakemake": _snakemake(place / "snakemake", snakemake, bare=given.bare),
        }
        seconds: dict[tuple[str, str], list[float]] = {}
        for repeat in range(-1, given.repeats):  # the first fills the caches of both
            for case, changed in (("all", None), ("no-op", ""), ("last", "accuracy"), ("middle", "strip_block")):
                for program, run in runs.items():
                    made, took = run(changed, 100.0 + repeat)
                    expected = {"all": 11, "no-op": 0, "last": 1, "middle": 4}[case]
                    assert made == expected, f"{program} made {made} stages, not {expected}, in {case}"
                    if repeat >= 0:
                        seconds.setdefault((case, program), []).append(took)
    sys.stdout.write(f"{'':8}{'aatri s':>10}{'snakemake s':>13}{'ratio':>8}\n")
    for case in ("no-op", "last", "middle", "all"):
        our_s, their_s = (statistics.median(seconds[case, program]) for program in ("aatri", "snakemake"))
        sys.stdout.write(f"{case:8}{our_s:10.2f}{their_s:13.2f}{their_s / our_s:8.1f}\n")


def _aatri(place: Path) -> Callable[[str | None, float], tuple[int, float]]:
    """A function that runs the made-up project: the stages made, and the seconds."""
    place.mkdir()
    pipeline = write_project(place)

    def run(changed: str | None, offset: float) -> tuple[int, float]:
        if changed is None:
            shutil.rmtree(place / "run", ignore_errors=True)
        elif changed:
            _replace_line(
                pipeline, f"  {changed}:", lambda line: line[: line.index("offset:")] + f"offset: {offset}}}}}"
            )
        before = _times(place / "run" / "current", "*.json")
        took = _timed([sys.executable, "-c", MAIN, "run", str(pipeline), "-q", "--local-plugins"], place)
        return len(_times(place / "run" / "current", "*.json") - before), took

    return run


def _snakemake(place: Path, snakemake: str, *, bare: bool) -> Callable[[str | None, float], tuple[int, float]]:
    """The same for Snakemake."""
    place.mkdir()
    (place / "add.py").write_text(ADD if bare else ADD_HDF5)
    python = f"{sys.executable} -I -S" if bare else sys.executable
    paths = {stage: ", ".join(f'"out/{source}.txt"' for source in sources) for stage, sources in WIRING.items()}
    rules = [RULE.format(stage=stage, inputs=inputs, python=python) for stage, inputs in paths.items()]
    targets = ", ".join(f'"out/{stage}.txt"' for stage in WIRING)
    head = f'configfile: "config.yaml"\n\nrule all:\n    input: {targets}\n\n'
    (place / "Snakefile").write_text(head + "".join(rules))
    config = place / "config.yaml"
    config.write_text("".join(f"{stage}: {k}.0\n" for k, stage in enumerate(WIRING)))

    def run(changed: str | None, offset: float) -> tuple[int, float]:
        if changed is None:
            shutil.rmtree(place / "out", ignore_errors=True)
        elif changed:
            _replace_line(config, f"{changed}:", lambda _: f"{changed}: {offset}")
        before = _times(place / "out", "*.txt")
        took = _timed([snakemake, "--cores", "1", "--quiet", "all"], place)
        return len(_times(place / "out", "*.txt") - before), took

    return run


def _timed(command: list[str], folder: Path) -> float:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(folder.parent / "bytecode")
    begin = time.perf_counter()
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    took = time.perf_counter() - begin
    assert done.returncode == 0, done.stdout + done.stderr
    return took


def _times(folder: Path, pattern: str) -> set[tuple[str, int]]:
    return {(path.name, path.stat().st_mtime_ns) for path in folder.glob(pattern)}


def _replace_line(path: Path, head: str, new: Callable[[str], str]) -> None:
    lines = path.read_text().splitlines()
    path.write_text("\n".join(new(line) if line.startswith(head) else line for line in lines) + "\n")


if __name__ == "__main__":
    main()
