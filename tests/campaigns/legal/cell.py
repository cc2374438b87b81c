"""What a legal block may be: a level of each factor."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

FACTORS: dict[str, tuple[str, ...]] = {
    "control": ("none", "one", "two", "perimeter", "full"),
    "positions": ("none", "all", "some"),
    "attitudes": ("none", "all"),
    "tilt": ("0", "5", "15", "40"),
    "camera": ("film", "digital"),
    "parameters": ("fixed", "free", "removable"),
    "sigmas": ("right", "half", "fifth"),
    "wrong": ("nothing", "gross", "control", "position", "few", "shuffled", "parallel", "weak"),
}
"""Factors and their levels: see docs/reliability.md."""


@dataclass(frozen=True)
class Cell:
    """One level of each factor, the seed of its block, of what class the sigmas are wrong, and how image points err.

    Errors are `normal`; `quality`: normal, 0.6 to 1.6 times the stated sigma by image; `t5`: Student's of five degrees
    of freedom, of the same sizes.
    """

    control: str
    positions: str
    attitudes: str
    tilt: str
    camera: str
    parameters: str
    sigmas: str
    wrong: str
    seed: int = 1
    sigmas_of: str = "image"
    noise: str = "normal"

    @property
    def factor(self) -> float:
        """Stated over true standard deviation, of the class `sigmas_of`."""
        return {"right": 1.0, "half": 0.5, "fifth": 0.2}[self.sigmas]

    def __str__(self) -> str:
        return " ".join(f"{f.name}={getattr(self, f.name)}" for f in fields(self))


def cell_of(text: str) -> Cell:
    """The cell that `str` has written."""
    given = dict(part.split("=") for part in text.split())
    return Cell(**{**given, "seed": int(given.pop("seed", 1))})  # type: ignore[arg-type]


def random_cell(seed: int) -> Cell:
    """Levels drawn at random."""
    rng = np.random.default_rng(seed)
    drawn = {name: str(rng.choice(levels)) for name, levels in FACTORS.items()}
    return Cell(**drawn, seed=seed, sigmas_of=str(rng.choice(["image", "control", "position", "all"])))  # type: ignore[arg-type]


def covering(seed: int = 1) -> list[Cell]:
    """Cells in which every pair of levels of two factors occurs: greedy, the best of some random candidates each time.

    Source: Cohen et al. 1997, The AETG system.
    """
    names, rng = list(FACTORS), np.random.default_rng(seed)
    pairs = {(a, x, b, y) for i, a in enumerate(names) for b in names[i + 1 :] for x in FACTORS[a] for y in FACTORS[b]}
    cells: list[Cell] = []
    while pairs:
        a, x, b, y = sorted(pairs)[rng.integers(len(pairs))]
        best: tuple[int, dict[str, str]] = (-1, {})
        for _ in range(60):
            drawn = {name: str(rng.choice(levels)) for name, levels in FACTORS.items()} | {a: x, b: y}
            best = max(best, (len(_of(drawn) & pairs), drawn), key=lambda found: found[0])
        pairs -= _of(best[1])
        cells.append(Cell(**best[1], seed=len(cells) + 1))  # type: ignore[arg-type]
    return cells


def _of(levels: dict[str, str]) -> set[tuple[str, str, str, str]]:
    names = list(levels)
    return {(a, levels[a], b, levels[b]) for i, a in enumerate(names) for b in names[i + 1 :]}


def clean(cell: Cell) -> Cell:
    """The same block with nothing wrong and right standard deviations."""
    return replace(cell, wrong="nothing", sigmas="right")
