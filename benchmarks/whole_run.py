"""A whole run from simulation to report: seconds, writing and peak memory of every stage, and what lies around them.

    python -m benchmarks.whole_run 100 40
    python -m benchmarks.whole_run 25 40 --tree ../other-checkout --set bundle.blunders=none

Preset `uav` with so many strips of so many images goes through the default chain, that of the demo with calibrated
interior, as one `aatri run` with search for gross errors and report; then once more, when nothing is left to do. The
run is watched from outside, every ten milliseconds: a stage is *made* while its file `running/STAGE.json` stands, and
*written* from when its folder in the store appears. *Around* is what comes before the first stage (imports, plan) and
after the last (report). Memory is the resident set of the process and its children. Processor seconds are those of all
threads, and suffer less from what else the machine does. Python keeps its compiled modules, as for a user. With
`--tree` the same is done on another checkout.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHAIN = """\
run: run
seed: 1
stages:
  block:       {{use: block/simulate, with: {{preset: uav, flight: {{strips: {strips}, images_per_strip: {images}}}}}}}
  interior:    {{use: interior_orientation/calibrated, from: {{block}}}}
  refined:     {{use: image_refinement/systematic, from: {{block, image_points: interior}}}}
  models:      {{use: relative_orientation/dependent, from: {{block, image_points: refined}}}}
  strips:      {{use: strip_formation/scale_transfer, from: {{block, models}}}}
  absolute:    {{use: absolute_orientation/similarity, from: {{block, strips, image_points: refined}}}}
  strip_block: {{use: strip_adjustment/polynomial,
                from: {{block, image_points: refined, strips, models, initial: absolute}}}}
  bundle:      {{use: bundle_adjustment/bundle, from: {{block, image_points: refined, initial: strip_block}}}}
  accuracy_absolute:    {{use: accuracy/evaluation, from: {{block, solution: absolute}}}}
  accuracy_strip_block: {{use: accuracy/evaluation, from: {{block, solution: strip_block}}}}
  accuracy:             {{use: accuracy/evaluation, from: {{block, solution: bundle}}}}
gates: none
"""
EVERY_S = 0.01


def main() -> None:
    """Run the chain here and, if asked, on another checkout."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("strips", type=int)
    parser.add_argument("images", type=int, help="per strip")
    parser.add_argument("--tree", help="another checkout to compare with")
    parser.add_argument("--set", action="append", default=[], metavar="STAGE.OPTION=VALUE", help="as of `aatri run`")
    parser.add_argument("--until", metavar="STAGE", help="as of `aatri run`")
    given = parser.parse_args()
    here = Path(__file__).parents[1]
    for tree in (here, *([Path(given.tree)] if given.tree else [])):
        sys.stdout.write(f"{tree.resolve()}\n\n{measured(tree, given)}\n")


def measured(tree: Path, given: argparse.Namespace) -> str:
    """The table of one checkout; compiled functions are made before, on a small block."""
    options = [word for value in given.set for word in ("--set", value)]
    options += ["--until", given.until] if given.until else []
    with tempfile.TemporaryDirectory() as name:
        for folder, strips, images in (("small", 3, 5), ("large", given.strips, given.images)):
            (Path(name) / folder).mkdir()
            text = CHAIN.format(strips=strips, images=images)
            (Path(name) / folder / "pipeline.yaml").write_text(text, encoding="utf-8")
            made = _watched(tree, Path(name) / folder, options)
        again = _watched(tree, Path(name) / "large", options)
        return _table(Path(name) / "large" / "run", made, again)


def _watched(tree: Path, folder: Path, options: list[str]) -> dict[str, list[float]]:
    """Seconds when each stage began, was first written and ended, with its peak memory; of "" for the whole run."""
    command = [sys.executable, "-c", "from aatri.cli.main import main; main()", "run", "--quiet", *options]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    before, started = children.ru_utime + children.ru_stime, time.perf_counter()
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**environment, "PYTHONPATH": str(tree.resolve())},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    found: dict[str, list[float]] = {}
    while process.poll() is None:
        now, memory = time.perf_counter() - started, _resident_gb(process.pid)
        for file in (folder / "run" / "running").glob("[!.]*.json"):
            stage = found.setdefault(file.stem, [now, float("nan"), now, 0.0])
            stage[2:] = [now, max(stage[3], memory)]
            if stage[1] != stage[1] and any((folder / "run" / "objects" / file.stem).glob("*")):
                stage[1] = now
        time.sleep(EVERY_S)
    seconds = time.perf_counter() - started
    if process.returncode:
        raise SystemExit(f"aatri run ended with exit code {process.returncode} in {folder}")
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {**found, "": [0.0, children.ru_utime + children.ru_stime - before, seconds, 0.0]}


def _resident_gb(pid: int) -> float:
    """Resident memory of a process and its children."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e9 + sum(_resident_gb(int(child)) for child in children)


def _table(run: Path, made: dict[str, list[float]], again: dict[str, list[float]]) -> str:
    lines = ["| stage | s | of it writing | processor s | peak GB |", "|---|---|---|---|---|"]
    _, processor, seconds, _ = made.pop("")
    for stage, (begun, written, ended, memory) in made.items():
        record = json.loads(next((run / "objects" / stage).glob("*/record.json")).read_text(encoding="utf-8"))
        writing = ended - written if written == written else 0.0
        lines.append(
            f"| {stage} | {ended - begun:.2f} | {writing:.2f} | {record['processor_seconds']:.2f} | {memory:.2f} |"
        )
    first, last = min(v[0] for v in made.values()), max(v[2] for v in made.values())
    lines.append(f"| before the first, after the last | {first:.2f}, {seconds - last:.2f} | | | |")
    lines.append(f"| all | {seconds:.2f} | | {processor:.2f} | |")
    _, processor, seconds, _ = again[""]
    lines.append(f"| once more, nothing to do | {seconds:.2f} | | {processor:.2f} | |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
