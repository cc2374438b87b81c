"""Let every write, fsync, close and rename of a run fail in turn, and see that nothing half-made is taken for whole.

    python -m tests.campaigns.faults all [--seed S] [--workers W] [--made-up]
    python -m tests.campaigns.faults 20

The calls of one run below its folder are counted: opening for writing, write, pwrite (HDF5), ftruncate, fsync, close,
rename, mkdir, symlink, unlink. Then a run is made for every call and each of two faults: EIO, once; ENOSPC, from that
call on, the first write cut to half. A number picks so many at random. `fault.c` makes the faults, so that those of the
HDF5 library are reached too. After each: every record has its whole artifact; the run either ended well in spite of it
(the fault hit the report, the log, a pointer that is set anew) with the right digests, or with exit code 8; and
`aatri run` completes it with the digests of the undisturbed run.
"""

from __future__ import annotations

import ctypes
import errno
import os
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

from tests.campaigns import harness

SOURCE = Path(__file__).with_name("fault.c")
FAULTS = {"EIO": (errno.EIO, False), "ENOSPC": (errno.ENOSPC, True)}


def main() -> None:
    parser = harness.arguments(__doc__, "faults, or `all`", count=lambda text: None if text == "all" else int(text))
    given, begin = parser.parse_args(), time.monotonic()
    _preload()
    with harness.workplace() as place:
        subject = harness.subject(place, given)
        expected, _ = harness.undisturbed(place, subject)
        calls = {fault: _calls(place, subject, fault) for fault in FAULTS}
        points = [(fault, at) for fault in FAULTS for at in range(1, len(calls[fault]) + 1)]
        chosen = points if given.count is None else random.Random(given.seed).sample(points, given.count)

        def one(point: tuple[str, int]) -> dict[str, int]:
            return _round(place, subject, expected, point, calls[point[0]][point[1] - 1])

        counted = harness.carry_out(one, chosen, given.workers)
    sys.stdout.write(f"calls of one run: {dict(sorted(Counter(c.split()[0] for c in calls['EIO']).items()))}\n")
    harness.conclude(f"faults: {len(chosen)} of {len(points)}", counted, begin)


def _preload() -> None:
    """Begin this process anew with the faults loaded, which are compiled first."""
    if "fault" in os.environ.get("LD_PRELOAD", ""):
        return
    library = harness.new_folder() / "fault.so"
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        sys.exit("faults: skipped: they need Linux and a C compiler")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
    command = [sys.executable, "-m", "tests.campaigns.faults", *sys.argv[1:]]
    code = subprocess.run(command, env={**os.environ, "LD_PRELOAD": str(library)}, check=False).returncode
    shutil.rmtree(library.parent)
    sys.exit(code)


def _arm(folder: Path, fault: str, at: int, log: int = -1) -> None:
    number, lasting = FAULTS[fault]
    ctypes.CDLL(None).fault_arm(os.fsencode(folder), ctypes.c_long(at), number, int(lasting), log)


def _calls(place: Path, subject: harness.Subject, fault: str) -> list[str]:
    """The calls of one run that the fault can hit, with their paths."""
    folder, log = place / f"calls-{fault}", os.open(place / f"calls-{fault}.txt", os.O_RDWR | os.O_CREAT)
    assert harness.run(subject.into(folder), place / "calls.out", before=lambda: _arm(folder, fault, 0, log)) == 0
    os.close(log)
    return (place / f"calls-{fault}.txt").read_text().replace(f"{folder}/", "").splitlines()


def _round(
    place: Path, subject: harness.Subject, expected: dict[str, str], point: tuple[str, int], call: str
) -> dict[str, int]:
    fault, at = point
    folder = place / f"{fault}-{at}"
    folder.mkdir()
    output, command = folder / "output.txt", subject.into(folder / "run")
    code = harness.run(command, output, before=lambda: _arm(folder / "run", fault, at))
    wrong = harness.problems(folder / "run", leftovers=False)
    if code not in (0, 8):
        wrong.append(f"exit code {code}: {output.read_text()[-600:]}")
    if code == 0 and harness.digests_of(folder / "run") != expected:
        wrong.append("ended well, but with other results")
    if code == 8 and str(folder / "run") not in output.read_text():
        wrong.append(f"no path in {output.read_text()[-600:]}")
    resumed = harness.run(command, output, before=harness.without_report)
    if resumed != 0:
        wrong.append(f"cannot be resumed: {resumed}: {output.read_text()[-600:]}")
    wrong += harness.problems(folder / "run")
    if resumed == 0 and harness.digests_of(folder / "run") != expected:
        wrong.append("resumed to other digests")
    shutil.rmtree(folder)
    if wrong:
        sys.stderr.write(f"{fault} at call {at}, {call}:\n  " + "\n  ".join(wrong) + "\n")
    return {f"{fault}": 1, f"ended with exit {code}": 1, "WRONG rounds" if wrong else "mended": 1}


if __name__ == "__main__":
    main()
