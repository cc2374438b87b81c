"""Kill a run at random moments, resume it, and compare with the undisturbed run.

    python -m tests.campaigns.kills 100 [--jobs N] [--seed S] [--workers W] [--made-up]

Every round begins a run in a new folder and kills it one to four times, also while it resumes: SIGKILL, now and then
SIGTERM or SIGINT. After each kill every record must have its whole artifact. Then it runs to its end: its content
digests must be those of the undisturbed run, and nothing half-written may be left.
"""

from __future__ import annotations

import random
import shutil
import signal
import sys
import time
from pathlib import Path

from tests.campaigns import harness

SIGNALS = [signal.SIGKILL] * 8 + [signal.SIGTERM, signal.SIGINT]


def main() -> None:
    parser = harness.arguments(__doc__, "rounds")
    parser.add_argument("--jobs", default="1")
    given, begin = parser.parse_args(), time.monotonic()
    with harness.workplace() as place:
        subject = harness.subject(place, given, "--jobs", given.jobs)
        expected, seconds = harness.undisturbed(place, subject)

        def one(number: int) -> dict[str, int]:
            return _round(place / f"round-{number}", subject, expected, seconds, f"{given.seed}:{number}")

        counted = harness.carry_out(one, range(given.count), given.workers)
    harness.conclude("kills", counted, begin)


def _round(
    folder: Path, subject: harness.Subject, expected: dict[str, str], seconds: float, seed: str
) -> dict[str, int]:
    chance = random.Random(seed)
    folder.mkdir()
    command = subject.into(folder / "run")
    counted = {"rounds": 1, "live kills": 0}
    wrong: list[str] = []
    for _ in range(chance.randint(1, 4)):
        child = harness.start(command, folder / "killed.txt")
        time.sleep(chance.uniform(0, seconds))
        counted["live kills"] += child.is_alive()
        child.kill(chance.choice(SIGNALS))
        code = child.wait()
        if code not in (0, -signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT, 130, 143):
            wrong.append(f"a killed run ended with {code}: {child.text()}")
        wrong += harness.problems(folder / "run", leftovers=False)
    code = harness.run(command, folder / "resumed.txt")
    if code != 0:
        wrong.append(f"the resumed run ended with {code}: {(folder / 'resumed.txt').read_text()}")
    wrong += harness.problems(folder / "run")
    if code == 0 and harness.digests_of(folder / "run") != expected:
        wrong.append("other digests")
    if wrong:
        sys.stderr.write(f"round {seed}: " + "\n".join(wrong) + "\n")
        return {**counted, "WRONG rounds": 1}
    shutil.rmtree(folder)
    return {**counted, "resumed to the same digests": 1}


if __name__ == "__main__":
    main()
