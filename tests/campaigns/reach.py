"""Which test files call which functions, so that a mutant is tried on the tests that can notice it and on no others.

    python -m tests.campaigns.reach --log reach.txt [--workers 2]

The quick subset and the slow tests of `tests/stages` run in a copy of the tree under a profile hook. Each function of
`aatri` and `stages` that is called while a test file runs is a line of the log: test file, file, qualified name; those
of processes that a test starts count for that test. Compiled functions call no hook: for them, and for what runs at
import, every test file counts that calls any function of a file that imports theirs. `mutants --reach reach.txt` reads
the log; it holds while the tests call what they called, and a test file that it does not know is always tried.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

from tests.campaigns import call_hook

ROOT = Path(__file__).resolve().parents[2]


def pytest_runtest_setup(item: Any) -> None:
    """As a plugin of pytest: what follows belongs to the file of this test."""
    call_hook.begin_of(Path(item.path))


class Reach:
    """What a log says."""

    def __init__(self, log: Path, tests: set[str], imports: dict[str, set[str]]) -> None:
        self._of_function: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._of_file: dict[str, set[str]] = defaultdict(set)
        known = set()
        for line in log.read_text(encoding="utf-8").splitlines():
            test, file, name = line.split("\t")
            self._of_function[file, name].add(test)
            self._of_file[file].add(test)
            known.add(test)
        self._unknown = tests - known
        self._importers: dict[str, set[str]] = defaultdict(set)
        for file, imported in imports.items():
            for other in imported:
                self._importers[other].add(file)

    def tests(self, file: str, source: str, line: int) -> set[str]:
        """Test files that can notice a change of a line; of those that the log knows, and all that it does not."""
        function = None if "kernels" in Path(file).parts else _function_at(source, line)
        if function is not None:
            return self._of_function[file, function] | self._unknown
        found = set(self._of_file[file])
        for other in self._importers[file]:
            found |= {other} if other.startswith("tests/") else self._of_file[other]
        return found | self._unknown


def _function_at(source: str, line: int) -> str | None:
    """Qualified name of the innermost function that holds a line."""
    found = None

    def visit(node: ast.AST, prefix: str) -> None:
        nonlocal found
        for child in ast.iter_child_nodes(node):
            inner = prefix
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                if not child.lineno <= line <= (child.end_lineno or child.lineno):
                    continue
                name = prefix + child.name
                is_class = isinstance(child, ast.ClassDef)
                inner = f"{name}." if is_class else f"{name}.<locals>."
                found = found if is_class else name
            visit(child, inner)

    visit(ast.parse(source), "")
    return found


def main() -> None:
    """Make a log."""
    from concurrent.futures import ThreadPoolExecutor

    from tests.campaigns import harness
    from tests.campaigns.mutant_trees import Tree

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--log", type=Path, required=True, help="file to write")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    given = parser.parse_args()
    log = given.log.resolve()
    log.unlink(missing_ok=True)
    with harness.workplace() as place, ThreadPoolExecutor(given.workers) as pool:
        trees = [Tree.copied(ROOT, place / f"worker-{k}", 1800.0) for k in range(given.workers)]
        every = sorted(trees[0].distance)
        shares = [every[k :: given.workers] for k in range(given.workers)]
        for text in pool.map(lambda tree, share: tree.watched(share, log), trees, shares):
            sys.stdout.write(f"{text}\n")


if __name__ == "__main__":
    main()
