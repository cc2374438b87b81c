"""Control and positions that are given far more exact than image points can tell."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.checks.after.sigmas import more_exact_than_images
from aatri.observations.poses import Poses
from tests.orientation.bodies.made_body import ALL, HEIGHT, MadeBody
from tests.small_blocks import C_MM, HEIGHT_M, SIGMA_MM, adjusted_by, flown

ON_GROUND_M = SIGMA_MM / C_MM * HEIGHT_M
"""15 mm: what an image point measures."""


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("kind", "times", "told"), [("control", 200, 1), ("control", 50, 0), ("position", 200, 1)])
def test_what_images_cannot_check_is_told(tmp_path: Path, kind: str, times: float, told: int) -> None:
    """Errors of the size that image points have, given as so many times smaller: a block may follow them."""
    small = flown(strips=2, per_strip=4)
    small.observed = small.observed if kind == "position" else {}
    small.control = small.control if kind == "control" else {}
    folder = small.write(tmp_path / "block")
    given, sigma_m = ("0.05", "exterior.csv") if kind == "position" else ("0.02", "block.yaml"), ON_GROUND_M / times
    text = (folder / given[1]).read_text()
    (folder / given[1]).write_text(
        text.replace(f"- {given[0]}\n", f"- {sigma_m}\n").replace(f",{given[0]}", f",{sigma_m}")
    )
    done = adjusted_by("default", folder, blunders={"sigmas": "given"})
    named = [text for text in done.warnings if "no test sees errors below that" in text]
    assert len(named) == told
    ratio = [float(text.split(" times smaller")[0].split()[-1]) for text in named if kind in text]
    assert ratio == pytest.approx([times] * told, rel=0.1)


def test_control_in_several_sets_is_told_once_by_the_median_of_all() -> None:
    """Sets of two, one and one points of 0.1, 10 and 1000 mm; an exact height counts for none; image points of 1 m."""
    body = MadeBody(np.zeros((4, 3)))
    body.control([0, 1], [ALL, ALL], 1e-4).control([2], [ALL], 1e-2).control([3], [ALL], 1.0).control([0], [HEIGHT], 0)
    sets = [
        AdjustedObservations(o, np.arange(len(o)), np.ones(len(o), dtype=bool), np.zeros((len(o), 3, 3)))
        for o in body.observed
    ]
    rays = SimpleNamespace(
        image=np.array([0]),
        point=np.array([0]),
        active=np.array([True]),
        sigma_mm=np.array([[0.1, 0.1]]),
        c_mm=np.array([100.0]),
    )
    poses = Poses(np.array([[0.0, 0.0, 1000.0]]), np.eye(3)[None])
    inputs = SimpleNamespace(rays=rays, poses=poses, xyz_m=np.zeros((1, 3)))
    (finding,) = more_exact_than_images(inputs, SimpleNamespace(observations=sets))  # type: ignore[arg-type]
    assert finding.where == "control"
    assert finding.statistic == pytest.approx(1.0 / (0.5 * (1e-4 + 1e-2)))
    assert "standard deviations of 5.0 mm are 198 times smaller" in finding.sentence
