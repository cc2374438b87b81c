"""Damage the files of a run in every way disks, copies and people do: all of it must be noticed.

    python -m tests.campaigns.corruptions 1000 [--seed S] [--workers W] [--made-up]

The damages: one bit flipped, a page of zeros, truncation, growth, the file of another stage, a stale one of an earlier
result of the same stage, removal, a symbolic link to a file of somebody else, and JSON that parses but that no record
can hold. They hit artifacts, records, the pointers in `current/`, and run.json. Afterwards `aatri run`
must end with whole files and the content digests of the undisturbed run, and it must have made again the stage whose
artifact or record was hit.

A part of the artifacts is hit *silently*: size and times as before, as when a disk loses bits. Then a run with
`--verify` must notice, and without it a stage that reads the artifact must end with exit code 7.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import sys
import time
from pathlib import Path

from tests.campaigns import harness

PAGE = 4096
WAYS = ("bit flip", "zeroed page", "truncation", "growth", "removal", "symlink", "swap", "stale file", "odd JSON")
FILES = ("artifact.h5", "artifact.h5", "record.json", "pointer", "link", "silent", "run.json")
ODD_JSON = (
    b'{"schema": 2, "x": NaN}',
    b'{"schema": 2, "x": 1e999}',
    b'{"schema": 2, "x": "\\ud800"}',
    b"[]",
    b"null",
    b'"x"',
    b'{"x": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
    b'{"schema": 2}',
    b'{"stages": [1], "status": "done"}',
)
ELSE = b"a file of somebody else\n"


def main() -> None:
    given, begin = harness.arguments(__doc__, "damages").parse_args(), time.monotonic()
    with harness.workplace() as place:
        subject = harness.subject(place, given)
        expected, _ = harness.undisturbed(place, subject)
        stale = ["--set", "block.offset=7" if given.made_up else "block.ties.new_points=170"]
        for arguments in (stale, []):
            assert (
                harness.run(subject.into(place / "base", *arguments), place / "base.txt", before=harness.without_report)
                == 0
            )
        assert harness.digests_of(place / "base") == expected

        def one(number: int) -> dict[str, int]:
            worker = place / f"worker-{os.getpid()}"
            if not worker.exists():
                shutil.copytree(place / "base", worker / "run", symlinks=True)
            return _round(worker, subject, expected, random.Random(f"{given.seed}:{number}"))

        counted = harness.carry_out(one, range(given.count), given.workers)
    harness.conclude("corruptions", counted, begin)


def _round(place: Path, subject: harness.Subject, expected: dict[str, str], chance: random.Random) -> dict[str, int]:
    run, output = place / "run", place / "output.txt"
    command = subject.into(run)
    stage, file = chance.choice(sorted(expected)), chance.choice(FILES)
    if file == "silent":
        assert harness.run(command, output, before=harness.without_report) == 0  # all digests are remembered
    name, way = _damage(run, stage, file, chance)
    wrong = []
    if file == "silent":
        reader = _reader_of(stage)
        if reader is not None:
            code = harness.run([*command, "--force", reader], output, before=harness.without_report)
            text = output.read_text()
            if code != 7 or "altered since it was written" not in text:
                wrong.append(f"{reader} read it: exit {code}: {text[-600:]}")
        command.append("--verify")
    code = harness.run([*command, "--json"], output, before=harness.without_report)
    if code != 0:
        wrong.append(f"exit {code}: {output.read_text()[-600:]}")
    elif file in ("artifact.h5", "record.json", "silent") and stage not in _made_last(run):
        wrong.append("not noticed")
    if (place / "else").exists() and (place / "else").read_bytes() != ELSE:
        wrong.append("the file that the link leads to was changed")
    wrong += harness.problems(run)
    if code == 0 and harness.digests_of(run) != expected:
        wrong.append("other digests")
    if wrong:
        sys.stderr.write(f"{way} of {name} of {stage}:\n  " + "\n  ".join(wrong) + "\n")
        shutil.rmtree(place)  # the next round begins with a whole copy
    return {f"{way} of {name}": 1, "WRONG rounds" if wrong else "noticed and mended": 1}


def _damage(run: Path, stage: str, file: str, chance: random.Random) -> tuple[str, str]:
    """Damage a file; which one, and how."""
    pointer = run / "current" / f"{stage}.json"
    key = json.loads(pointer.read_bytes())["key"]
    objects = {"artifact.h5": "artifact.h5", "silent": "artifact.h5", "record.json": "record.json"}
    if file in objects:
        path = run / "objects" / stage / key / objects[file]
        others = {"swap": run.glob(f"objects/*/*/{path.name}"), "stale file": path.parents[1].glob(f"*/{path.name}")}
    elif file == "run.json":
        path, others = run / "run.json", {}
    else:
        path = pointer if file == "pointer" else pointer.with_suffix(".h5")
        older = "record.json" if file == "pointer" else "artifact.h5"
        others = {"swap": path.parent.glob(f"*{path.suffix}"), "stale file": run.glob(f"objects/{stage}/*/{older}")}
    ways = WAYS[:2] if file == "silent" else WAYS if path.suffix == ".json" else WAYS[:-1]
    way = chance.choice([w for w in ways if others or w not in ("swap", "stale file")])
    before, data = path.stat(), bytearray(path.read_bytes())
    if way == "removal":
        path.unlink()
        return file, way
    if way == "symlink":
        path.unlink()
        (run.parent / "else").write_bytes(ELSE)
        path.symlink_to(run.parent / "else")
        return file, way
    damaged = _damaged(data, way, [p.read_bytes() for p in sorted(others.get(way, ()))], chance)
    if file == "link":  # an editor or a copy put a file in the place of the link
        path.unlink()
    path.write_bytes(damaged)
    if file == "silent":
        _hide(path, before)
    return file, way


def _damaged(data: bytearray, way: str, others: list[bytes], chance: random.Random) -> bytes:
    at = chance.randrange(len(data))
    if way == "odd JSON":
        return chance.choice(ODD_JSON)
    if way == "bit flip":
        data[at] ^= 1 << chance.randrange(8)
    elif way == "zeroed page":
        page = slice(at // PAGE * PAGE, at // PAGE * PAGE + PAGE)
        data[page] = bytes(len(data[page])) if any(data[page]) else b"\1" * len(data[page])
    elif way == "truncation":
        del data[at:]
    elif way == "growth":
        data += chance.randbytes(chance.randint(1, PAGE))
    else:
        return chance.choice([other for other in others if other != data])
    return bytes(data)


def _hide(path: Path, before: os.stat_result) -> None:
    """Let what is remembered of a file speak of its present state, as if its size and times had not changed."""
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    now = path.stat()
    for cache in Path(os.environ["XDG_CACHE_HOME"]).glob("aatri/files-*.json"):
        known = json.loads(cache.read_bytes())
        if str(path) in known:
            known[str(path)]["stat"] = [now.st_size, now.st_mtime_ns, now.st_ctime_ns, now.st_ino]
            known[str(path)]["seen"] = now.st_ctime_ns + 10**10
            cache.write_text(json.dumps(known))


def _reader_of(stage: str) -> str | None:
    """A stage that reads the artifact of another."""
    readers = {
        "block": "interior",
        "interior": "refined",
        "refined": "models",
        "models": "strips",
        "strips": "absolute",
        "absolute": "accuracy_absolute",
        "strip_block": "accuracy_strip_block",
        "bundle": "accuracy",
    }
    return readers.get(stage)


def _made_last(run: Path) -> list[str]:
    """The stages that the last run made."""
    events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    last = max(k for k, event in enumerate(events) if event["event"] == "started")
    return [event["stage"] for event in events[last:] if event["event"] == "stage done"]


if __name__ == "__main__":
    main()
