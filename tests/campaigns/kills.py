"""Kill a run at random moments, resume it, and compare with the undisturbed run.

    python -m tests.campaigns.kills 100 [pipeline.yaml] [--jobs N]

Every round starts `aatri run` in a new folder, kills it with SIGKILL (now and then SIGTERM or SIGINT) up to four times,
also while it resumes, then lets it end. All content digests must be those of the undisturbed run, every record must
have its whole artifact, and no temporary file may be left.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIGNALS = [signal.SIGKILL] * 8 + [signal.SIGTERM, signal.SIGINT]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rounds", type=int)
    parser.add_argument("pipeline", nargs="?", default="pipeline.yaml")
    parser.add_argument("--jobs", default="1")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as place:
        begin = time.monotonic()
        whole = Path(place) / "whole"
        assert aatri(given, whole).wait() == 0
        seconds, expected = time.monotonic() - begin, digests(whole)
        kills = 0
        for number in range(given.rounds):
            folder = Path(place) / "killed"
            for _ in range(chance.randint(1, 4)):
                kills += kill_one(given, folder, chance, seconds)
            code = aatri(given, folder).wait()
            found = digests(folder)
            left = list(folder.rglob(".tmp-*"))
            if code != 0 or found != expected or left:
                sys.exit(
                    f"round {number}: exit {code}, left {left}, differs {set(expected.items()) ^ set(found.items())}"
                )
            shutil.rmtree(folder)
        sys.stdout.write(f"{given.rounds} rounds, {kills} live kills: all resumed to the undisturbed result\n")


def kill_one(given: argparse.Namespace, folder: Path, chance: random.Random, seconds: float) -> bool:
    """Start a run and kill it at a random moment; whether it was still alive."""
    process = aatri(given, folder)
    time.sleep(chance.uniform(0, seconds))
    alive = process.poll() is None
    process.send_signal(chance.choice(SIGNALS))
    process.wait()
    return alive


def aatri(given: argparse.Namespace, folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", "from aatri.cli.main import main; main()", "run", given.pipeline, "-q",
               "--into", str(folder), "--jobs", given.jobs]  # fmt: skip
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def digests(folder: Path) -> dict[str, str]:
    """Content digest of every current result, each checked against its file."""
    from aatri.pipeline.cache import file_sha256
    from aatri.pipeline.objects import artifact_file, read_record

    found = {}
    for path in sorted((folder / "current").glob("*.json")):
        record = read_record(path)
        assert record is not None
        assert file_sha256(artifact_file(folder, record)) == record["output"]["sha256"], path
        found[path.stem] = record["output"]["content_digest"]
    for path in folder.glob("objects/*/*/record.json"):
        record = json.loads(path.read_text())
        assert file_sha256(path.parent / record["output"]["file"]) == record["output"]["sha256"], path
    return found


if __name__ == "__main__":
    main()
