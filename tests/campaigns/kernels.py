"""Edit a function that a compiled kernel of another file calls: the result must follow every edit.

    python -m tests.campaigns.kernels 10

Numba's own cache looks at the file of the compiled function only, and would run the machine code of the function as it
was. A project's stage multiplies photo coordinates by a factor that comes from such a function; after each edit its
result must be that factor times the coordinates of the unedited stage, and a factor met before must compile nothing.
"""

from __future__ import annotations

import random
import sys
import time
from pathlib import Path
from typing import Any

from tests.campaigns import harness

INNER = """\
from numba import njit


@njit("float64(float64)", cache=True)
def inner(x):
    return {factor} * x
"""
OUTER = """\
from numba import njit

from .inner import inner


@njit("void(float64[:, :], float64[:, :])", cache=True)
def outer(given, result):
    for i in range(given.shape[0]):
        for k in range(given.shape[1]):
            result[i, k] = inner(given[i, k])
"""
STAGE = '''\
"""Interior orientation by a compiled function."""
from dataclasses import replace
import numpy as np
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.plugin import stage
from aatri.stages.interior_orientation.affine import affine
from .kernels.outer import outer

@stage(version=1)
def compiled(block: Block) -> ImagePoints:
    """The affine one, times a factor."""
    points = affine(block)
    xy_mm = np.empty_like(points.measurements.xy_mm)
    outer(np.array(points.measurements.xy_mm), xy_mm)
    return replace(points, measurements=replace(points.measurements, xy_mm=xy_mm))
'''
INTERIOR = "  interior:    {use: interior_orientation/compiled, from: {block}}\n"


def main() -> None:
    given, begin = harness.arguments(__doc__, "edits").parse_args(), time.monotonic()
    chance, counted = random.Random(given.seed), {"edits": 0}
    with harness.workplace() as place:
        pipeline, role = place / "pipeline.yaml", place / "stages" / "interior_orientation"
        pipeline.write_text(harness.PIPELINE + INTERIOR)
        (role / "kernels").mkdir(parents=True)
        (role / "compiled.py").write_text(STAGE)
        (role / "kernels" / "outer.py").write_text(OUTER)
        first = _xy_mm(place, pipeline, 1)
        for _ in range(given.count):
            factor = chance.randint(1, 5)
            counted["edits"] += 1
            verdict = "followed" if (_xy_mm(place, pipeline, factor) == factor * first).all() else "WRONG results"
            counted[verdict] = counted.get(verdict, 0) + 1
    harness.conclude("kernels", counted, begin)


def _xy_mm(place: Path, pipeline: Path, factor: int) -> Any:
    """Photo coordinates as the stage makes them with a factor."""
    import h5py

    (place / "stages" / "interior_orientation" / "kernels" / "inner.py").write_text(INNER.format(factor=factor))
    command, output = ["run", pipeline, "-q", "--local-plugins"], place / "output.txt"
    if harness.run(command, output, before=harness.without_report) != 0:
        sys.exit(output.read_text())
    with h5py.File(place / "run" / "current" / "interior.h5") as file:
        return file["measurements/xy_mm"][:]


if __name__ == "__main__":
    main()
