"""What nothing observed places the points marked `datum: yes` do, by their approximate coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import closed_form, transform
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from tests.stages.film_blocks import Told
from tests.stages.hand_block import Hand, hand, read

FULL_POINT_AND_HEIGHTS = {14: (0, 1, 2), 0: (2,), 5: (2,), 24: (2,)}
"""A point known in full and three heights: kappa is open, and over flat ground the scale nearly."""


def with_datum_points(
    folder: Path, marked: list[int], axes: dict[int, tuple[int, ...]], relief_m: float = 50.0
) -> tuple[Hand, Any, Block, ImagePoints]:
    """The block with control in these axes, and datum points by approximate coordinates that are 10 m off."""
    of = hand(relief_m=relief_m)
    control = [",".join([f"p{p:02}", *(f"{v!r}" if k in known else "" for k, v in enumerate(of.xyz_m[p].tolist()))])
               for p, known in axes.items()]  # fmt: skip
    near_m = of.xyz_m[marked] + 10.0 * np.random.default_rng(5).standard_normal((len(marked), 3))
    near = [f"p{p:02},{x!r},{y!r},{z!r},approximate,yes" for p, (x, y, z) in zip(marked, near_m.tolist())]
    ground = "\n".join(["point,X,Y,Z,role,datum", *(f"{row},control,no" for row in control), *near, ""])
    noisy = of.xy_mm + 0.005 * np.random.default_rng(3).standard_normal(of.xy_mm.shape)
    return of, near_m, *read(folder, of, ground=ground, xy_mm=noisy)


MARKED = BundleOptions(datum="free", datum_over="marked")


@pytest.mark.slow
@pytest.mark.parametrize("marked", [[2, 9, 17, 27], [2, 27], []])
def test_what_control_leaves_open_the_datum_points_close(tmp_path: Path, marked: list[int]) -> None:
    of, _, block, points = with_datum_points(tmp_path, marked, FULL_POINT_AND_HEIGHTS)
    if not marked:
        with pytest.raises(GeometryError, match="rotation about Z"):
            graph(block, points, rng=np.random.default_rng(1))
        return
    begin, told = graph(block, points, rng=np.random.default_rng(1)), Told()
    assert np.abs(begin.points.xyz_m - of.xyz_m).max() < 40.0
    solution = bundle(block, points, begin, options=MARKED, context=told)
    assert 0.85 < solution.sigma0 < 1.15
    np.testing.assert_allclose(solution.points.xyz_m[14], of.xyz_m[14], atol=0.05)
    np.testing.assert_allclose(solution.points.xyz_m[[0, 5, 24], 2], of.xyz_m[[0, 5, 24], 2], atol=0.1)
    assert any(text.startswith("hardly determined: scale") for text in told.warnings)  # heights tell it by the relief


@pytest.mark.slow
def test_the_scale_that_heights_over_flat_ground_do_not_tell_is_named(tmp_path: Path) -> None:
    _, _, block, points = with_datum_points(tmp_path, [2, 9, 17, 27], FULL_POINT_AND_HEIGHTS, relief_m=0.0)
    begin = graph(block, points, rng=np.random.default_rng(1))
    for blunders, error in (("none", GeometryError), ("robust_snooping", ConvergenceError)):
        with pytest.raises(error, match="scale of the whole block") as caught:
            bundle(block, points, begin, options=BundleOptions(**MARKED.model_dump() | {"blunders": blunders}))
        assert "`approximate`" in caught.value.remedy


@pytest.mark.slow
def test_without_control_the_datum_points_place_the_block(tmp_path: Path) -> None:
    """Where they do not, as two do not, the first base is 1."""
    marked = [0, 5, 24, 29]
    of, near_m, block, points = with_datum_points(tmp_path, marked, {})
    begin = graph(block, points, rng=np.random.default_rng(1))
    expected = transform(closed_form(of.xyz_m[marked], near_m), of.xyz_m)
    np.testing.assert_allclose(begin.points.xyz_m, expected, atol=0.3)  # 3 cm is what an image point measures
    solution = bundle(block, points, begin, options=MARKED)
    np.testing.assert_allclose(solution.points.xyz_m, expected, atol=0.3)
    assert begin.datum is not None
    assert begin.datum.id.tolist() == ["p00", "p05", "p24", "p29"]
    _, _, block, points = with_datum_points(tmp_path, marked[:2], {})
    base_m = np.diff(graph(block, points, rng=np.random.default_rng(1)).images.position_m[:2], axis=0)
    assert 0.2 < float(np.linalg.norm(base_m)) < 5.0
