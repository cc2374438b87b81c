"""Copies of the tree in which mutants are tried, and the order in which tests are run on them.

A copy lies beside a link to the real data, where there are any, and has its own caches, with the compiled kernels of
the original. Tests that import the changed module run first, those of the same room before others, the fewest imports
away first.
"""

from __future__ import annotations

import ast
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path

from tests.campaigns.call_hook import LOG

NEAR = 8
"""So many test files are run before all the others are even collected."""
LEFT_BEHIND = ("__pycache__", ".*_cache", ".git", ".venv", "runs", "build", "dist", "*.egg-info", ".hypothesis")


@dataclass
class Tree:
    """A copy of the tree."""

    root: Path
    limit_s: float
    distance: dict[str, dict[str, int]]
    """Test file -> file of the code -> imports between them."""
    failing: set[str] = field(default_factory=set)
    sound: set[str] = field(default_factory=set)
    original: tuple[str, str] | None = None
    imports: dict[str, set[str]] = field(default_factory=dict)
    watch: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def copied(root: Path, place: Path, limit_s: float) -> Tree:
        """A copy below `place`."""
        tree = place / "tree"
        shutil.copytree(root, tree, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
        if (root.parent / "shared").exists():
            (place / "shared").symlink_to(root.parent / "shared")
        if (compiled := Path(os.environ["NUMBA_CACHE_DIR"])).is_dir():  # by content: a mutant's own come beside them
            shutil.copytree(compiled, place / "numba")
        tests = sorted(p.relative_to(tree).as_posix() for p in (tree / "tests").rglob("test_*.py"))
        imports = {name: set(_imports(tree, name)) for name in _sources(tree)}
        wanted = [t for t in tests if not t.startswith("tests/campaigns/")]
        return Tree(tree, limit_s, {test: _distances(test, imports) for test in wanted}, imports=imports)

    @contextlib.contextmanager
    def holding(self, file: str, text: str) -> Iterator[None]:
        """The tree with another text of one file."""
        path = self.root / file
        self.original = (file, path.read_text(encoding="utf-8"))
        compiled = set(self.root.parent.glob("numba/*"))
        try:
            self._write(file, text)
            yield
        finally:
            self._write(*self.original)
            self.original = None
            if "kernels" in Path(file).parts:
                for folder in set(self.root.parent.glob("numba/*")) - compiled:
                    shutil.rmtree(folder)

    def _write(self, file: str, text: str) -> None:
        path = self.root / file
        for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            compiled.unlink()  # which would pass for that of a text as long, written within the same second
        path.write_text(text, encoding="utf-8")

    def watched(self, tests: Sequence[str], log: Path) -> str:
        """Run tests under the hook of `reach`; the last line of what they say."""
        site = self.root.parent / "site"
        site.mkdir(exist_ok=True)
        text = "from tests.campaigns.call_hook import begin\n\nbegin()\n"
        (site / "sitecustomize.py").write_text(text, encoding="utf-8")
        slow = [test for test in tests if test.startswith("tests/stages/")]
        self.watch = {LOG: str(log), "PYTHONPATH": f"{site}{os.pathsep}{self.root}"}
        ends = [self._run(some, mark) for some, mark in [(tests, "not slow"), (slow, "slow")]]
        return "; ".join(" ".join(end) for end in ends)

    def killer(self, file: str, near_only: bool, able: Set[str] | None = None) -> tuple[str, str]:
        """Verdict on the tree as it is, and the test that gave it; `able`: the test files that can notice, if known."""
        order = [test for test in self.order(file) if able is None or test in able]
        near = [test for test in order if file in self.distance[test] or _is_mirror(test, file)][:NEAR]
        rest = [test for test in order if test not in near]
        slow = [test for test in order if test.startswith("tests/stages/")]
        for tests, marked in [(near, "not slow")] + ([] if near_only else [(rest, "not slow"), (slow, "slow")]):
            if tests and (found := self._first_failure(tests, marked)):
                return found
        return "survived", ""

    def order(self, file: str) -> list[str]:
        """Test files, those first that are most likely to notice a change of a file."""
        far = 1 + max(max(d.values(), default=0) for d in self.distance.values())

        def key(test: str) -> tuple[float, str]:
            return self.distance[test].get(file, far) - 1.5 * _is_mirror(test, file), test

        return sorted(self.distance, key=key)

    def _first_failure(self, tests: Sequence[str], marked: str) -> tuple[str, str] | None:
        """The first failure that is not there without the mutant; None if there is none."""
        while True:
            verdict, by = self._run(tests, marked)
            if verdict == "passed":
                return None
            if verdict == "hung" or "::" not in by or by in self.sound or not self._fails_anyway(by):
                return verdict, by
            self.failing.add(by)

    def _fails_anyway(self, test: str) -> bool:
        """Whether a test fails on the unchanged tree too."""
        assert self.original is not None
        file, text = self.original
        changed = (self.root / file).read_text(encoding="utf-8")
        self._write(file, text)
        fails = self._run([test], "slow or not slow")[0] != "passed"
        self._write(file, changed)
        if not fails:
            self.sound.add(test)
        return fails

    def _run(self, tests: Sequence[str], marked: str) -> tuple[str, str]:
        """passed, killed or hung, and the first test that failed, or under way when progress ended."""
        place = self.root.parent
        output = place / "output.txt"
        aside = [f"--deselect={test}" for test in self.failing]
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-v",
            "-p",
            "no:cacheprovider",
            "-rfE",
            "--tb=no",
            "-m",
            marked,
        ]
        command += ["-p", "tests.campaigns.reach", "--maxfail=1000"] if self.watch else []
        command += [f"--basetemp={place / 'tests'}", *aside, *tests]
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.root),
            "PYTHONUNBUFFERED": "1",
            "XDG_CACHE_HOME": str(place / "cache"),
            "NUMBA_CACHE_DIR": str(place / "numba"),
            **self.watch,
        }
        with output.open("wb") as out:
            process = subprocess.Popen(
                command,
                cwd=self.root,
                env=environment,
                stdout=out,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )
            try:
                hung = _makes_no_progress(process, output, self.limit_s)
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)  # its own session: what it started ends with it
                process.wait()
        text = output.read_text(errors="replace")
        if hung:
            started = re.findall(r"^(tests/\S+)", text, re.MULTILINE)
            return "hung", started[-1] if started else "while collecting"
        if process.returncode in (0, 5):  # 5: nothing of these is marked so
            return "passed", ""
        failed = re.findall(r"^(?:FAILED|ERROR) (tests/\S.*?)(?: - .*)?$", text, re.MULTILINE)
        if not failed:  # the process itself died, as compiled code does that writes where it must not
            failed = re.findall(r"^(tests/\S+)", text, re.MULTILINE)[-1:]
        return "killed", failed[0] if failed else f"pytest ended with {process.returncode}"


def _makes_no_progress(process: subprocess.Popen[bytes], output: Path, limit_s: float) -> bool:
    """Wait for the end; True as soon as its output has not grown for so many seconds."""
    size, since = -1, time.monotonic()
    while process.poll() is None:
        time.sleep(0.1)
        if output.stat().st_size != size:
            size, since = output.stat().st_size, time.monotonic()
        elif time.monotonic() - since > limit_s:
            return True
    return False


def _is_mirror(test: str, file: str) -> bool:
    """Whether a test lies in the room of tests that mirrors the file's own."""
    room = Path(file).parent.as_posix().removeprefix("aatri/").removesuffix("/kernels")
    return (Path(test).parent.as_posix() + "/").startswith(f"tests/{room}/")


def _sources(tree: Path) -> list[str]:
    """Files of the code and of the tests."""
    return [p.relative_to(tree).as_posix() for top in ("aatri", "stages", "tests") for p in (tree / top).rglob("*.py")]


def _imports(tree: Path, name: str) -> Iterator[str]:
    """Files that a file imports by name, inside functions too."""
    for node in ast.walk(ast.parse((tree / name).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            modules = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        else:
            continue
        for module in modules:
            path = module.replace(".", "/") + ".py"
            path = path.removeprefix("aatri/") if path.startswith("aatri/stages/") else path
            if (tree / path).is_file():
                yield path


def _distances(start: str, imports: dict[str, set[str]]) -> dict[str, int]:
    """Every file reached from one, and by how many imports."""
    found, waiting = {start: 0}, [start]
    for name in waiting:
        for other in sorted(imports[name] - found.keys()):
            found[other] = found[name] + 1
            waiting.append(other)
    return found
