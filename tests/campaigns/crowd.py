"""Start sixteen runs in one folder at once: one wins, the others end with exit code 8 and say who is there.

python -m tests.campaigns.crowd 10 [pipeline.yaml]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.campaigns.kills import digests

AT_ONCE = 16


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rounds", type=int)
    parser.add_argument("pipeline", nargs="?", default="pipeline.yaml")
    given = parser.parse_args()
    expected = None
    for number in range(given.rounds):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "run"
            command = [sys.executable, "-c", "from aatri.cli.main import main; main()", "run", given.pipeline, "-q",
                       "--into", str(folder)]  # fmt: skip
            crowd = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                     for _ in range(AT_ONCE)]  # fmt: skip
            told = [process.communicate()[1] for process in crowd]
            codes = sorted(process.returncode for process in crowd)
            if set(codes) - {0, 8} or 0 not in codes:
                sys.exit(f"round {number}: exit codes {codes}\n{''.join(told)}")
            found = digests(folder)
            expected = expected or found
            if found != expected:
                sys.exit(f"round {number}: other results")
            sys.stdout.write(f"{codes.count(0)} went through, {codes.count(8)} were told that another run is there\n")


if __name__ == "__main__":
    main()
