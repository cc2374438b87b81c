"""Change the code in one small place, and see whether a test notices: what survives, no test holds.

    python -m tests.campaigns.mutants --count 100 --seed 1 [--under aatri/geometry] [--workers 2] [--near] [--reach LOG]

Each mutant is made in a copy of the tree (the changes: `mutations`). First run the tests near it, by the mirror of the
tree and by import, then the rest of the quick subset, then the slow ones of `tests/stages`; the first test that fails
kills it. With a log of `reach` only test files that call the changed function are run. A test that fails without the
mutant too kills nothing and is set aside. Tests that print no progress for `--limit` seconds hang: killed as well.
Mutants that change no result are listed by hand, with the reason, in `equivalent_mutants.yaml`. The end is a list of
the survivors and the share killed of those not equivalent; below `--at-least` per cent the campaign has failed. Kernels
are compiled anew for each of their mutants: half a minute.
"""

from __future__ import annotations

import argparse
import difflib
import queue
import random
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import yaml

from tests.campaigns import harness
from tests.campaigns.mutant_trees import Tree
from tests.campaigns.mutations import Mutation, is_another_program, mutations
from tests.campaigns.reach import Reach

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.yaml")


@dataclass(frozen=True)
class Mutant:
    """A change of one file of the tree."""

    file: str
    source: str
    change: Mutation

    @property
    def place(self) -> str:
        return f"{self.file}:{self.change.line}"

    @property
    def lines(self) -> tuple[str, str]:
        """The lines that differ, as they are and as they become."""
        before, after = self.source.splitlines(), self.change.applied(self.source).splitlines()
        told = list(difflib.unified_diff(before, after, n=0, lineterm=""))[3:]
        old, new = ("\n".join(line[1:].strip() for line in told if line[0] == sign) for sign in "-+")
        return old, new


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: killed, hung, survived or equivalent; by which test, or why."""

    mutant: Mutant
    verdict: str
    by: str

    def text(self) -> str:
        old, new = self.mutant.lines
        return f"{self.verdict:10} {self.mutant.place}\n    - {old}\n    + {new}\n    {self.by}\n"


def all_mutants(root: Path, under: tuple[str, ...]) -> list[Mutant]:
    """Every change of the files of `aatri` and `stages` whose path begins so."""
    files = sorted(p for top in ("aatri", "stages") for p in (root / top).rglob("*.py"))
    names = ((path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")) for path in files)
    return [Mutant(name, source, m) for name, source in names if name.startswith(under) for m in mutations(source)]


def chosen(mutants: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """So many of them by chance."""
    order = random.Random(seed).sample(mutants, len(mutants))
    found: list[Mutant] = []
    for mutant in order:
        if len(found) < count and is_another_program(mutant.source, mutant.change):
            found.append(mutant)
    return found


def equivalents() -> dict[tuple[str, str, str], str]:
    """Reasons by file, lines as they are and as they become."""
    entries = yaml.safe_load(EQUIVALENT.read_text(encoding="utf-8")) or []
    return {(e["file"], e["was"].strip(), e["becomes"].strip()): e["reason"] for e in entries}


def outcome(
    mutant: Mutant,
    trees: queue.Queue[Tree],
    known: dict[tuple[str, str, str], str],
    near_only: bool,
    reach: Reach | None,
) -> Outcome:
    """Try one mutant in a tree that is free."""
    reason = known.get((mutant.file, *mutant.lines))
    if reason is not None:
        return Outcome(mutant, "equivalent", reason)
    able = None if reach is None else reach.tests(mutant.file, mutant.source, mutant.change.line)
    tree = trees.get()
    try:
        with tree.holding(mutant.file, mutant.change.applied(mutant.source)):
            verdict, by = tree.killer(mutant.file, near_only, able)
    finally:
        trees.put(tree)
    return Outcome(mutant, verdict, by)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="mutants")
    parser.add_argument("--seed", type=int, default=0, help="of their choice")
    parser.add_argument("--under", nargs="+", default=[""], help="only files whose path begins so, e.g. aatri/geometry")
    parser.add_argument("--workers", type=int, default=1, help="mutants side by side")
    parser.add_argument("--near", action="store_true", help="only the tests near the mutant")
    parser.add_argument("--reach", type=Path, help="log of which tests call what (see `reach`): only those are run")
    parser.add_argument("--limit", type=float, default=180.0, help="seconds without progress after which tests hang")
    parser.add_argument("--at-least", type=float, default=85.0, help="per cent killed, else exit code 1")
    given, begin = parser.parse_args(), time.monotonic()
    known, trees = equivalents(), queue.Queue[Tree]()
    with harness.workplace() as place:
        for k in range(given.workers):
            trees.put(Tree.copied(ROOT, place / f"worker-{k}", given.limit))
            tree = trees.queue[-1]
        reach = Reach(given.reach, set(tree.distance), tree.imports) if given.reach else None
        mutants = chosen(all_mutants(ROOT, tuple(given.under)), given.count, given.seed)
        with ThreadPoolExecutor(given.workers) as pool:
            outcomes = []
            for one in pool.map(lambda m: outcome(m, trees, known, given.near, reach), mutants):
                outcomes.append(one)
                sys.stdout.write(one.text())
                sys.stdout.flush()
        while not trees.empty():
            for test in trees.get().failing:
                sys.stdout.write(f"fails without a mutant, set aside: {test}\n")
    _conclude(outcomes, given.at_least, time.monotonic() - begin)


def _conclude(outcomes: list[Outcome], at_least: float, seconds: float) -> None:
    """Survivors and figures; exit code 1 if too few were killed."""
    of = {
        verdict: [o for o in outcomes if o.verdict == verdict]
        for verdict in ("killed", "hung", "survived", "equivalent")
    }
    sys.stdout.write("\nSurvivors:\n" + "".join(o.text() for o in of["survived"]))
    dead, alive = len(of["killed"]) + len(of["hung"]), len(of["survived"])
    share = 100.0 * dead / max(dead + alive, 1)
    figures = ", ".join(f"{len(some)} {verdict}" for verdict, some in of.items())
    sys.stdout.write(f"mutants: {figures}; {share:.0f} % of the others than equivalent ones killed; {seconds:.0f} s\n")
    if dead + alive and share < at_least:
        sys.exit(1)


if __name__ == "__main__":
    main()
