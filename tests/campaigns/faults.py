"""Let one write, fsync, close or rename of a run fail with ENOSPC or EIO, then resume it.

    python -m tests.campaigns.faults 100 [pipeline.yaml]

The calls of one undisturbed run in its folder are counted; so many of them, evenly spread, fail one at a time (all, if
the number is as large). Afterwards every record must have its whole artifact, the exit code must be that of resources
(8) unless the run got over it, and the resumed run must end with the content digests of the undisturbed one. Needs a C
compiler and Linux.
"""

from __future__ import annotations

import argparse
import errno
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.campaigns.kills import digests


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("pipeline", nargs="?", default="pipeline.yaml")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        shim = Path(place) / "faults.so"
        source = Path(__file__).with_suffix(".c")
        subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-w", "-o", shim, source, "-ldl"], check=True)
        folder, log = Path(place) / "run", Path(place) / "calls"
        assert run(given.pipeline, folder, shim, log, 0, 0) == 0
        expected, calls = digests(folder), int(log.read_text())
        codes: Counter[int] = Counter()
        for k in range(min(given.count, calls)):
            shutil.rmtree(folder)
            at, number = 1 + k * calls // min(given.count, calls), (errno.ENOSPC, errno.EIO)[k % 2]
            code = run(given.pipeline, folder, shim, log, at, number)
            codes[code] += 1
            digests(folder)  # whatever has a record is whole
            if code not in (0, 8):
                sys.exit(f"call {at} of {calls}, {errno.errorcode[number]}: exit {code}")
            if run(given.pipeline, folder, shim, log, 0, 0) != 0 or digests(folder) != expected:
                sys.exit(f"call {at} of {calls}, {errno.errorcode[number]}: not resumed to the undisturbed result")
        sys.stdout.write(f"{sum(codes.values())} of {calls} calls failed once, exit codes {dict(codes)}: all resumed\n")


def run(pipeline: str, folder: Path, shim: Path, log: Path, at: int, number: int) -> int:
    """Run with the `at`-th call failing; the exit code."""
    faults = {"LD_PRELOAD": str(shim), "FAULT_DIR": str(folder), "FAULT_LOG": str(log), "FAULT_AT": str(at),
              "FAULT_ERRNO": str(number)}  # fmt: skip
    command = [sys.executable, "-c", "from aatri.cli.main import main; main()", "run", pipeline, "-q",
               "--into", str(folder)]  # fmt: skip
    done = subprocess.run(command, env={**os.environ, **faults}, capture_output=True, text=True)
    if done.returncode not in (0, 8):
        sys.stderr.write(done.stderr)
    return done.returncode


if __name__ == "__main__":
    main()
