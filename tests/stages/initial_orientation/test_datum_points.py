"""What nothing observed places the points marked `datum: yes` do, by their approximate coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
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
    folder: Path,
    marked: list[int],
    axes: dict[int, tuple[int, ...]],
    relief_m: float = 50.0,
    rays: Callable[[Hand], Any] | None = None,
) -> tuple[Hand, Any, Block, ImagePoints]:
    """The block with control in these axes, and datum points by approximate coordinates that are 10 m off.

    `rays` says which image points are measured, all without it.
    """
    of = hand(relief_m=relief_m)
    if rays is not None:
        measured = rays(of)
        of = replace(of, image=of.image[measured], point=of.point[measured], xy_mm=of.xy_mm[measured])
    control = [
        ",".join([f"p{p:02}", *(f"{v!r}" if k in known else "" for k, v in enumerate(of.xyz_m[p].tolist()))])
        for p, known in axes.items()
    ]
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
    marked = [0, 5, 24, 29]
    of, near_m, block, points = with_datum_points(tmp_path, marked, {})
    begin = graph(block, points, rng=np.random.default_rng(1))
    expected = transform(closed_form(of.xyz_m[marked], near_m), of.xyz_m)
    np.testing.assert_allclose(begin.points.xyz_m, expected, atol=0.3)  # 3 cm is what an image point measures
    solution = bundle(block, points, begin, options=MARKED)
    np.testing.assert_allclose(solution.points.xyz_m, expected, atol=0.3)
    assert begin.datum is not None
    assert begin.datum.id.tolist() == ["p00", "p05", "p24", "p29"]


@pytest.mark.slow
def test_datum_points_that_do_not_place_the_block_are_named_with_the_reason(tmp_path: Path) -> None:
    """The first base is 1 then, as two points leave the turn about their line open."""
    _, _, block, points = with_datum_points(tmp_path, [0, 5], {})
    told = Told()
    base_m = np.diff(graph(block, points, rng=np.random.default_rng(1), context=told).images.position_m[:2], axis=0)
    assert 0.2 < float(np.linalg.norm(base_m)) < 5.0
    (text,) = (text for text in told.warnings if "datum points" in text)
    assert text.startswith("datum points p00, p05 do not place the block: ")
    assert "rotation about" in text
    assert text.endswith("mark three or more that are not on one line")


def _one_strip_each(of: Hand) -> Any:
    """Rays of the southern points in the images of the first strip, and of the others in those of the second."""
    return (of.xyz_m[of.point, 1] < 200.0) == (of.image < 3)


@pytest.mark.slow
@pytest.mark.parametrize("north", [[18, 23, 29], [29]])
def test_each_of_two_components_is_placed_by_its_own_datum_points(tmp_path: Path, north: list[int]) -> None:
    """Which the solution lists, only those that it has; where they do not place the second it stays apart."""
    south = [0, 5, 8]
    of, _, block, points = with_datum_points(tmp_path, south + north, {}, rays=_one_strip_each)
    told = Told()
    begin = graph(block, points, rng=np.random.default_rng(1), context=told)
    placed, both = np.isfinite(begin.points.xyz_m).all(axis=1), len(north) > 1
    assert begin.datum is not None
    assert begin.datum.id.tolist() == [f"p{p:02}" for p in (south + north if both else south)]
    assert np.abs((begin.points.xyz_m - of.xyz_m)[placed]).max() < 60.0
    assert placed[north].all() == both
    apart = [text for text in told.warnings if "stays apart" in text]
    assert len(apart) == (not both)
    assert all("datum points p00, p05, p08, p29 do not place component 2 (3 images): " in text for text in apart)
