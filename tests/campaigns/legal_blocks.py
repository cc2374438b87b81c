"""Legal blocks of all kinds through the whole chain: none is lost, none is wrong without a word.

    python -m tests.campaigns.legal_blocks --covering [--ways chain graph]
    python -m tests.campaigns.legal_blocks --count 2000 --seed 1 [--levels sigmas=right parameters=fixed]
    python -m tests.campaigns.legal_blocks --cell "control=two ... seed=5" --ways graph [--keep FOLDER]

Factors, levels and ends: tests/campaigns/legal. `--keep` writes the block and a pipeline.yaml, for `aatri run`.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

from tests.campaigns.legal.cell import Cell, cell_of, covering, random_cell
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.folder import WAYS, write_project
from tests.campaigns.legal.judged import BAD, end_of


def carried_through(cells: list[Cell], ways: list[str], show_warnings: bool) -> int:
    """Every cell every way; how many ended badly."""
    ends, lost, good = Counter[str](), 0, 0
    for cell in cells:
        for way in ways:
            end = end_of(cell, way)
            ends[end.outcome] += 1
            lost, good = lost + end.lost, good + end.good
            if end.outcome != "good" or show_warnings:
                say(f"{end.outcome}: --ways {way} --cell '{cell}'\n    {end.why.strip()}")
            for text in end.warnings if show_warnings or end.outcome in ("told", "REJECTED") else ():
                say(f"    warning: {text}")
    say(", ".join(f"{name} {count}" for name, count in ends.most_common()) + f"; {lost} of {good} good lost")
    return sum(ends[name] for name in BAD)


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--covering", action="store_true", help="a fixed set with every pair of levels")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--levels", nargs="+", default=[], help="of random cells, FACTOR=LEVEL")
    parser.add_argument("--cell", type=cell_of)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--keep", type=Path)
    chosen = parser.parse_args()
    if chosen.cell and chosen.keep:
        write_project(scene_of(chosen.cell), chosen.keep, chosen.ways[0])
    levels = dict(level.split("=") for level in chosen.levels)
    drawn = [replace(random_cell(chosen.seed + k), **levels) for k in range(chosen.count)]
    cells = [chosen.cell] if chosen.cell else drawn
    cells = covering() if chosen.covering else cells
    sys.exit(1 if carried_through(cells, chosen.ways, chosen.cell is not None) else 0)


if __name__ == "__main__":
    main()
