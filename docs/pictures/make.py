"""The pictures of the documentation: python docs/pictures/make.py [NAME]...

Every picture is a file beside this one. SVG files are drawn as the report draws: sketches (`sketches.py`), and
pictures of runs of the tutorial's block and of recipes. PNG files are screenshots of pages (`screenshots.py`), by the
Chromium of the machine, where it and playwright are there. `tests/acceptance/test_pictures.py` makes all again and
compares.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import curves
import numpy as np
import screenshots
import sketches

import aatri
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.report.drawing.picture import ChartAxis, Marks, Picture
from aatri.report.drawing.standalone import standalone

HERE = Path(__file__).parent
DOCS = HERE.parent
CONTROL = 1
"""In the column `role` of ground points."""

FROM = {"block": "block", "image_points": "interior", "initial": "start"}
QUARRY: dict[str, Any] = {
    "block": {"use": "block/tables", "with": {"path": str(DOCS / "tutorial" / "quarry")}},
    "interior": {"use": "interior_orientation/calibrated", "from": {"block": "block"}},
    "start": {"use": "initial_orientation/graph", "from": {"block": "block", "image_points": "interior"}},
    "bundle": {
        "use": "bundle_adjustment/bundle",
        "from": FROM,
        "with": {"reliability": True, "variance_components": {}},
    },
    "accuracy": {"use": "accuracy/evaluation", "from": {"block": "block", "solution": "bundle"}},
}
CALIBRATED: dict[str, Any] = QUARRY | {
    "bundle": {"use": "bundle_adjustment/bundle", "from": FROM, "with": {"self_calibration": {"set": "brown_conrady"}}}
}
OF_RUNS = {
    "quarry": {
        "accuracy": "differences_plan",
        "reliability_of_observations": "redundancy",
        "variance_components": "groups",
        "initial_orientation": "ties",
    },
    "calibrated": {"self_calibration": "image_errors_frame20"},
    "network": {"networks": "network"},
    "design": {"design": "planned_sigma_height"},
    "epochs": {"epochs": "displacements_plan_movements"},
}
"""Pictures of the report by run: the name of the file, and that of the picture."""


def pictures(names: set[str], folder: Path) -> Iterator[tuple[str, Picture]]:
    """Pictures by the name of their file: those asked for, or all."""
    drawn_alone = sketches.MADE | {"image_refinement": curves.image_refinement, "frames": curves.frames}
    yield from ((name, draw()) for name, draw in drawn_alone.items() if not names or name in names)
    of_quarry = {"bundle_adjustment": bundle, "gross_errors": tests}
    for run_name, wanted in OF_RUNS.items():
        more = of_quarry if run_name == "quarry" else {}
        if names and not names & {*wanted, *more}:
            continue
        run = _run(run_name, folder)
        drawn: Mapping[str, Picture] = run.plot().pictures
        yield from ((name, drawn[of]) for name, of in wanted.items() if not names or name in names)
        yield from ((name, draw(run)) for name, draw in more.items() if not names or name in names)


def _run(name: str, folder: Path) -> Any:
    stages = {"quarry": QUARRY, "calibrated": CALIBRATED}.get(name)
    if stages is None:
        return aatri.run(DOCS / "recipes" / f"{name}.yaml", into=folder / name)
    return aatri.run({"run": str(folder / name), "stages": stages})


def bundle(run: Any) -> Picture:
    """The bundle of rays from the side, as the adjustment left it."""
    block: Block = run["block"].artifact
    solution: Solution = run["bundle"].artifact
    m, up = block.image_points, np.ix_(range(len(solution.images)), (0, 2))
    centres, points = solution.images.position_m[up], solution.points.xyz_m[:, [0, 2]]
    strip = np.flatnonzero(block.images.strip == 1)
    rows = np.flatnonzero(np.isin(m.image, strip) & np.isfinite(points[m.point]).all(axis=1))
    control = block.ground_points.point[(block.ground_points.role == CONTROL).any(axis=1)]
    rays = Marks("segments", np.stack([centres[m.image[rows]], points[m.point[rows]]], 1), "amber", "rays", width=0.4)
    marks = [
        rays,
        Marks("dots", points[np.unique(m.point[rows])], "ink", "points", width=3.5),
        Marks("triangles", points[control], "red", "control"),
        Marks("dots", centres[strip], "blue", "projection centres", width=8.0),
    ]
    return Picture(
        "bundle", "A bundle of rays: the middle strip of the tutorial's block, from the side", "", marks, ground=False
    )


def tests(run: Any) -> Picture:
    """Test statistics of all observations, the largest first, with those that were left out."""
    solution: Solution = run["bundle"].artifact
    w = (
        np.sort(np.nan_to_num(np.abs(solution.tests.test)).max(axis=1))[::-1]
        if solution.tests is not None
        else np.zeros(0)
    )
    used = np.stack([np.arange(1.0, len(w) + 1), np.maximum(w, 1e-2)], 1)
    out = np.sort(solution.suspects.test)[::-1]
    left_out = np.stack([np.arange(1.0, len(out) + 1), out], 1)
    marks = [
        Marks("dots", used, "blue", "kept", width=3.0),
        Marks("crosses", left_out, "red", "left out: the four mistakes of the tutorial"),
    ]
    across = ChartAxis("observations, the largest first", 0.0, float(len(w)))
    return Picture(
        "tests", "Test statistic |w| of every observation", "", marks, across, ChartAxis("|w|", 0.01, 1e4, True)
    )


def files(names: set[str], folder: Path) -> Iterator[tuple[str, bytes]]:
    """Files by name: those asked for, or all; `folder` takes the runs."""
    for name, picture in pictures(names, folder):
        yield f"{name}.svg", f"{standalone(picture)}\n".encode()
    if (
        screenshots.chromium()
        and importlib.util.find_spec("playwright")
        and (not names or names & set(screenshots.PARTS))
    ):
        yield from ((f"{name}.png", content) for name, content in screenshots.taken(_pages(folder)).items())


def _pages(folder: Path) -> Path:
    """The report of the tutorial's first run, and its comparison with a calibrated one: a folder with both pages."""
    project = Path(shutil.copytree(DOCS / "tutorial", folder / "tutorial"))
    run = aatri.run(project / "pipeline.yaml", into=project / "run")
    aatri.run(project / "pipeline.yaml", into=project / "calibrated", set=["bundle.self_calibration.set=brown_conrady"])
    command = [str(Path(sys.executable).with_name("aatri")), "compare", "run", "calibrated", "--page", "compared.html"]
    subprocess.run(command, cwd=project, check=True, capture_output=True)
    shutil.copy(run.report, project)
    return project


def main(arguments: list[str]) -> None:
    """Write the files."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files(set(arguments), Path(folder)):
            (HERE / name).write_bytes(content)
            sys.stdout.write(f"{name}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
