"""Blocks in which nothing is wrong, at defaults: what is rejected, warned of, or lit in colour.

    python -m tests.campaigns.false_alarms --count 20 [--first 1] [--noise normal quality t5] [--ways chain graph]

Five kinds of blocks (film, UAV, with attitudes, with positions alone, with control alone) with normal errors of the
standard deviations stated; with normal errors whose size is 0.6 to 1.6 of the stated one, image by image (quality);
and with Student's errors of five degrees of freedom of such sizes (t5). Wanted: of normal errors of the stated sizes
nothing rejected by any stage, no warning, no coloured light; of the others less than 0.1 % left out of the result.
`few check points` (there are four) and `truth` lights are not counted.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.errors import AatriError
from aatri.report.verdict import BAD, LOOK, external_lights, internal_lights
from aatri.report.view.run_view import RunView, StageView
from aatri.tables.schema import Artifact
from tests.campaigns.legal.cell import Cell
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.folder import WAYS
from tests.campaigns.legal.judged import Ear, read, through

_RIGHT = {"parameters": "fixed", "sigmas": "right", "wrong": "nothing"}
KINDS = {
    "film": Cell("full", "none", "none", "0", "film", **_RIGHT),
    "uav": Cell("perimeter", "all", "none", "5", "digital", **_RIGHT),
    "attitudes": Cell("perimeter", "all", "all", "5", "digital", **_RIGHT),
    "positions": Cell("none", "all", "none", "0", "film", **_RIGHT),
    "control": Cell("perimeter", "none", "none", "5", "digital", **_RIGHT),
}
NOISES = ("normal", "quality", "t5")
MOST_LEFT_OUT = 0.001


@dataclass(frozen=True)
class Alarms:
    """What a block with nothing wrong was blamed of."""

    observations: int
    rejected: tuple[str, ...]
    left_out: int
    warnings: tuple[str, ...]
    lights: tuple[str, ...]


def alarms(cell: Cell, way: str) -> Alarms:
    """Carry a block through and collect."""
    ear, scene = Ear(), scene_of(cell)
    try:
        made = through(cell, read(scene, ear), way, ear)
    except AatriError as error:
        return Alarms(0, (), 0, (f"{ear.stage}: {error}",), ())
    suspects = [(name, a.suspects) for name, a in made.items() if hasattr(a, "suspects")]
    rejected = {(s.kind[k], s.image[k], s.point[k]) for _, s in suspects for k in np.flatnonzero(s.staying_out)}
    named = tuple(" ".join(part for part in map(str, row) if part) for row in sorted(rejected))
    return Alarms(len(scene.xy_mm), named, left_out(made["bundle"].suspects), tuple(ear.warnings), lights(made))


def left_out(suspects: Suspects) -> int:
    """How many observations a result does without; ties of models are made of image points."""
    return int((suspects.staying_out & ~np.isin(suspects.kind, ("model_tie", "strip_tie"))).sum())


def lights(made: dict[str, Artifact]) -> tuple[str, ...]:
    """Lights of the report that are neither good nor without an answer."""
    stages = tuple(StageView(name, "", a.kind, {}, {"metrics": a.metrics()}, None, ()) for name, a in made.items())
    run = RunView(Path(), {}, stages, dict(made))
    shown = [*internal_lights(run, run.last(Solution)), *external_lights(run)]
    return tuple(f"{x.title}: {x.words}" for x in shown if x.state in (LOOK, BAD) and "fewer than" not in x.words)


def kind_of(text: str) -> str:
    """A warning or light without ids and numbers."""
    return re.sub(r"\b[sip]*\d[\w.,/-]*", "#", text)[:110]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--noise", nargs="+", choices=NOISES, default=NOISES)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    chosen = parser.parse_args()
    failed = 0
    for noise in chosen.noise:
        for way in chosen.ways:
            for name, cell in KINDS.items():
                seeds = range(chosen.first, chosen.first + chosen.count)
                failed += _told(name, noise, way, [alarms(replace(cell, seed=s, noise=noise), way) for s in seeds])
    sys.exit(1 if failed else 0)


def _told(name: str, noise: str, way: str, of: list[Alarms]) -> bool:
    rejected, out, total = (sum(n) for n in zip(*((len(a.rejected), a.left_out, a.observations) for a in of)))
    said = Counter(kind_of(text) for a in of for text in (*a.warnings, *a.lights))
    counts = f"{rejected} of {total} rejected, {out} of them left out; {sum(said.values())} remarks"
    sys.stdout.write(f"{name}, {noise}, {way}: {counts}\n")
    for text, count in said.most_common():
        sys.stdout.write(f"    {count} x {text}\n")
    for a in of if rejected and noise == "normal" else ():
        sys.stdout.write("".join(f"    rejected {row}\n" for row in a.rejected))
    sys.stdout.flush()
    return out > MOST_LEFT_OUT * total if noise != "normal" else bool(rejected or said)


if __name__ == "__main__":
    main()
