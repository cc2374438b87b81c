"""Start sixteen runs in one folder at the same moment: one wins, the others leave at once and say who is there.

    python -m tests.campaigns.concurrency 20

The runs are started up and then let go together; what counts is the time from there. Exactly one may make stages, and
each stage once; the others must end with exit code 8 and the message of the lock, or, had the winner ended before they
came to the lock, find that nothing is to be done. The seconds that the losers took are printed; sixteen processes share
the cores, so on a machine of few they wait for each other.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import sys
import time
from pathlib import Path

from tests.campaigns import harness

AT_ONCE = 16


def main() -> None:
    given, begin = harness.arguments(__doc__, "rounds").parse_args(), time.monotonic()
    seconds: list[float] = []
    counted: dict[str, int] = {}
    with harness.workplace() as place:
        subject = harness.subject(place, given)
        expected, _ = harness.undisturbed(place, subject)
        for number in range(given.count):
            found, losers = _round(place / f"round-{number}", subject, expected)
            seconds += losers
            for name in found:
                counted[name] = counted.get(name, 0) + 1
    figures = f"{statistics.median(seconds):.2f} s, the slowest {max(seconds):.2f} s" if seconds else "none"
    sys.stdout.write(f"losers left after (median) {figures}\n")
    harness.conclude(f"concurrency: {given.count} rounds", counted, begin)


def _round(folder: Path, subject: harness.Subject, expected: dict[str, str]) -> tuple[list[str], list[float]]:
    """What became of each run, and the seconds after which losers left."""
    folder.mkdir()
    gate, opener = os.pipe()

    def wait() -> None:
        harness.without_report()
        os.close(opener)
        os.read(gate, 1)  # returns when the last writer has closed the pipe

    crowd = [harness.start(subject.into(folder / "run"), folder / f"{k}.txt", before=wait) for k in range(AT_ONCE)]
    time.sleep(0.2)
    os.close(opener)
    os.close(gate)
    begin = time.monotonic()
    found: list[str] = []
    losers: list[float] = []
    by_pid = {child.pid: child for child in crowd}
    for _ in crowd:
        pid, status = os.wait()
        code, text = os.waitstatus_to_exitcode(status), by_pid[pid].text()
        if code == 8 and ("busy: aatri run" in text or "another process writes there" in text):
            losers.append(time.monotonic() - begin)
            found.append("told that another run is there")
        elif code == 0:
            found.append("ended well")
        else:
            found.append(f"WRONG exit {code}: {text}")
    events = [json.loads(line) for line in (folder / "run" / "events.jsonl").read_text().splitlines()]
    made = [event["stage"] for event in events if event["event"] == "stage done"]
    if sorted(made) != sorted(expected) or sum(event["event"] == "started" for event in events) != 1:
        found.append(f"WRONG: made {made}")
    if harness.digests_of(folder / "run") != expected:
        found.append("WRONG digests")
    found += [f"WRONG: {problem}" for problem in harness.problems(folder / "run")]
    shutil.rmtree(folder)
    return found, losers


if __name__ == "__main__":
    main()
