"""Trace every file that aatri opens, makes, replaces or removes, and see that none lies where it has no business.

    python -m tests.campaigns.opened_files [--short]

Under strace (Debian package strace; without it the campaign is skipped and says so): the demo (`--short`: the small
block of the other campaigns), a block of tables, then show, status, metrics, report, compare, export and gc of its run,
and runs of it with a hostile link in the place of each of its files and folders. Opened may be: the run folder, the
inputs that the pipeline names, the cache; the folder that an export was asked to go to; the folder of temporary files;
and, to read only, the installation (Python, its libraries, aatri's own code) and what the system's libraries look at
(/etc, /proc, /sys, /dev, /usr, /lib). What the links lead to is in a folder of its own, which no process may open, even
to read, and whose content must stay.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterable
from pathlib import Path

from tests.campaigns import harness
from tests.formats.tables.block_folder import write_folder

ROOT = Path(__file__).resolve().parents[2]
CALLS = (
    "trace=open,openat,openat2,creat,unlink,unlinkat,rename,renameat,renameat2,truncate,link,linkat,symlink,symlinkat,"
    "mkdir,mkdirat,rmdir"
)
SYSTEM = ("/etc/", "/proc/", "/sys/", "/dev/", "/usr/", "/lib", "/bin/")
SECRET = b"of the user's, and no business of aatri's\n"
TABLES = """\
run: out
stages:
  block: {use: block/tables, with: {path: block}}
"""
LINKS = (
    ".lock",
    "events.jsonl",
    "run.json",
    "report.html",
    "report.json",
    "current",
    "objects",
    "previous",
    "running",
    "failed",
    "variants",
    "checkpoints",
    "items",
    "accepted",
    "current/block.json",
    "current/block.h5",
    "running/block.log",
    "running/block.json",
    "objects/block",
    "objects/block/KEY",
    "objects/block/KEY/artifact.h5",
    "objects/block/KEY/record.json",
    "objects/block/KEY/stage.log",
    "previous/block.json",
    "failed/block",
    "failed/block/error.json",
    "failed/block/stage.log",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="a small block instead of the demo, and one link")
    given, begin = parser.parse_args(), time.monotonic()
    if shutil.which("strace") is None:
        sys.exit("opened_files: skipped: no strace here")
    counted = {"commands": 0, "calls": 0}
    wrong: list[str] = []
    with harness.workplace() as place:
        secret = place / "secret"
        (secret / "block" / "KEY").mkdir(parents=True)
        for folder in (secret, secret / "block", secret / "block" / "KEY"):
            for name in ("file", "block.json", "record.json", "artifact.h5", "error.json", "stage.log"):
                (folder / name).write_bytes(SECRET)
        (place / "tmp").mkdir()
        os.environ["TMPDIR"] = str(place / "tmp")  # where libraries try whether they may write
        project, tables = place / "project", place / "tables"
        project.mkdir()
        if given.short:
            harness.write_pipeline(project)
        else:
            shutil.copy(ROOT / "pipeline.yaml", project)
        tables.mkdir()
        (tables / "pipeline.yaml").write_text(TABLES)
        write_folder(tables / "block")

        def trace(folder: Path, *arguments: str, more: Iterable[Path] = (), codes: tuple[int, ...] = (0,)) -> None:
            code, calls = _traced(folder, arguments, place / "trace.txt")
            allowed = (
                place / "tmp",
                folder,
                Path(os.environ["XDG_CACHE_HOME"]),
                Path(os.environ["NUMBA_CACHE_DIR"]),
                *more,
            )
            found = _elsewhere(calls, folder, allowed, secret)
            if code not in codes:
                found.append(f"exit code {code}")
            wrong.extend(f"{' '.join(arguments)}: {one}" for one in found)
            counted["commands"] += 1
            counted["calls"] += len(calls)

        trace(project, "run", "-q")
        run = "runs/demo" if not given.short else "run"
        trace(project, "export", run, "tables", str(place / "exported"), more=[place / "exported"])
        trace(project, "gc", run, "--keep", "0")
        trace(tables, "run", "-q")
        for verb in (
            ["show", "out:block"],
            ["show", "out/current/block.h5"],
            ["status"],
            ["metrics", "out"],
            ["dag"],
            ["report", "out"],
            ["compare", "out", "out"],
        ):
            trace(tables, *verb)
        trace(tables, "export", "out:block", "tables", str(place / "block"), more=[place / "block"])
        for link in ("current/block.json",) if given.short else LINKS:
            _attack(tables, link, secret, trace)
        for path in secret.rglob("*"):
            if path.is_file() and path.read_bytes() != SECRET:
                wrong.append(f"{path} was changed")
    for text in wrong:
        sys.stderr.write(text + "\n")
    harness.conclude("opened_files", counted | ({"WRONG": len(wrong)} if wrong else {}), begin)


def _attack(tables: Path, link: str, secret: Path, trace: object) -> None:
    """Put a link to the secret in the place of a file or folder of the run, and go on working with the run."""
    out = tables / "out"
    shutil.copytree(out, tables / "whole", symlinks=True)
    (key,) = [p.name for p in (out / "objects" / "block").iterdir()][:1]
    place = out / link.replace("KEY", key)
    is_file = "." in place.name or place.name in ("KEY",)
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(secret / "file" if is_file else secret)
    for verb in (
        ["run", "-q", "--force", "block"],
        ["gc", "out", "--keep", "0"],
        ["show", "out:block"],
        ["status", "out"],
        ["report", "out"],
        ["export", "out:block", "tables", "exported", "--overwrite"],
    ):
        trace(tables, *verb, codes=(0, 2, 7))  # type: ignore[operator]
    shutil.rmtree(out)
    (tables / "whole").rename(out)


def _traced(folder: Path, arguments: tuple[str, ...], told: Path) -> tuple[int, list[tuple[str, str, bool]]]:
    """Exit code of `aatri ARGUMENTS`, and its calls: name, path, and whether it was to write."""
    code = "import sys; from aatri.cli.main import main; sys.exit(main())"
    command = [
        "strace",
        "-f",
        "-qq",
        "--seccomp-bpf",  # stops at the calls that are asked for, not at every one: half the time
        "-s",
        "4096",
        "-e",
        CALLS,
        "-o",
        str(told),
        sys.executable,
        "-c",
        code,
        *arguments,
    ]
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"},
    )
    calls = []
    for line in told.read_text(errors="replace").splitlines():
        if match := re.match(r"\d+ +(\w+)\((.*)\) += (-?\d+)", line):
            name, inner, result = match.groups()
            writes = not name.startswith("open") or bool(re.search(r"O_(WRONLY|RDWR|CREAT|TRUNC|APPEND)", inner))
            calls += [(name, path, writes) for path in re.findall(r'"((?:[^"\\]|\\.)*)"', inner) if int(result) >= 0]
    return done.returncode, calls


def _elsewhere(calls: list[tuple[str, str, bool]], folder: Path, allowed: Iterable[Path], secret: Path) -> list[str]:
    """What was opened where aatri has no business."""
    installed = {
        Path(p).resolve()
        for p in (*sysconfig.get_paths().values(), *filter(os.path.isabs, sys.path), sys.base_prefix, sys.prefix, ROOT)
    }
    found = set()
    for name, text, writes in calls:
        path = Path(os.path.normpath(folder / text))
        real = Path(os.path.realpath(path))
        if any(p == secret or secret in p.parents for p in (path, real)) and name.startswith("open"):
            found.add(f"{name} {path} leads to the secret")
        if _within(path, allowed):
            continue
        if not writes and (str(path).startswith(SYSTEM) or _within(path, installed)):
            continue
        if (writes and str(path) in ("/dev/null", "/dev/shm")) or name.startswith("symlink") or path == folder.parent:
            continue  # the text of a link is no path that is opened
        found.add(f"{name} {path}" + (" to write" if writes else ""))
    return sorted(found)


def _within(path: Path, folders: Iterable[Path]) -> bool:
    return any(path == folder or folder in path.parents for folder in folders)


if __name__ == "__main__":
    main()
