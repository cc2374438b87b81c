"""A free datum rests on its start values whatever the search for gross errors does: what is open shows no shift."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import ConvergenceError, GeometryError
from aatri.orientation.bundle import free_datum
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.small_blocks import adjusted_by, flown
from tests.stages.film_blocks import Told

if TYPE_CHECKING:
    from aatri.adjustment.stepping.adjusted import Adjusted

MARKED = ["p20", "p25", "p30", "p35", "p40", "p45"]


@pytest.fixture(scope="module", params=["clean", "wrong", "left out before"])
def started(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Block, ImagePoints, Solution]:
    """A block with one control point, and a start that all its control has given, 0.3 m off everywhere at random.

    Of the wrong one a ray is 1.5 mm off; of the last an earlier stage has left out two rays that are right.
    """
    small, folder = flown(2, 4), tmp_path_factory.mktemp("free")
    whole = tables(options=TablesOptions(path=small.write(folder / "whole")))
    initial = graph(whole, calibrated(whole), rng=np.random.default_rng(1))
    if request.param == "wrong":
        ray = "102", small.seen_by("102")[7]
        small.rays[ray] = small.rays[ray] + [1.5, 0.7]
    small.control, small.observed = {"C1": "XYZ"}, {}
    block = tables(options=TablesOptions(path=small.write(folder / "one")))
    ground = np.isin(block.points.id, MARKED)
    block = replace(block, ground_points=_marked(block, np.flatnonzero(ground)))
    rng = np.random.default_rng(2)
    images, points = initial.images, initial.points
    initial = replace(
        initial,
        images=replace(images, position_m=images.position_m + rng.normal(0, 0.3, images.position_m.shape)),
        points=replace(points, xyz_m=points.xyz_m + rng.normal(0, 0.3, points.xyz_m.shape)),
    )
    if request.param == "left out before":
        initial = replace(initial, suspects=_rejected(block, initial, [20, 90]))
    return block, calibrated(block), initial


def _marked(block: Block, points: np.ndarray):
    """The ground points with start values of some more, on which the datum may rest."""
    g = block.ground_points
    more = g.take(np.zeros(len(points), dtype=np.intp))
    more = replace(
        more,
        point=points.astype(np.int32),
        datum=np.ones(len(points), dtype=bool),
        role=np.full_like(more.role, 3),
        xyz_m=np.full((len(points), 3), np.nan),
    )
    names = type(g).__dataclass_fields__
    return type(g)(**{name: np.concatenate([getattr(g, name), getattr(more, name)]) for name in names})


def _rejected(block: Block, initial: Solution, rows: list[int]):
    m, n = block.image_points, len(rows)
    return type(initial.suspects)(
        kind=np.full(n, "image_point"),
        row=np.array(rows, dtype=np.int32),
        image=block.images.id[m.image[rows]],
        point=block.points.id[m.point[rows]],
        stage=np.full(n, "relative_orientation"),
        size=np.full(n, 0.1),
        unit=np.full(n, "mm"),
        sigma=np.full(n, 0.003),
        test=np.full(n, 30.0),
        verdict=np.full(n, "rejected"),
    )


@pytest.mark.parametrize("over", ["points", "images", "marked"])
@pytest.mark.parametrize("method", ["robust_snooping", "data_snooping", "none"])
def test_the_datum_has_no_rotation_and_no_scale_against_its_start(
    started: tuple[Block, ImagePoints, Solution], method: str, over: str
) -> None:
    """About the control point, which alone stays: sum (x - c) x (x - x_start) = 0, sum (x - c)'(x - x_start) = 0."""
    block, points, initial = started
    options = BundleOptions(datum="free", datum_over=over, blunders={"method": method}, max_sigma0=100.0)
    done = bundle(block, points, initial, options=options)
    assert done.datum is not None
    if over == "images":
        x, start = done.images.position_m, initial.images.position_m
    else:
        some = np.isin(done.points.id, done.datum.id)
        x, start = done.points.xyz_m[some], initial.points.xyz_m[some]
    known = np.isfinite(x).all(axis=1) & np.isfinite(start).all(axis=1)
    assert known.sum() >= (6 if over == "marked" else 8)
    centre = done.points.xyz_m[done.points.id == "C1"][0]
    arm, off = (x - centre)[known], (x - start)[known]
    size = (arm**2).sum()
    turn, scale = np.cross(arm, off).sum(axis=0) / size, (arm * off).sum() / size
    np.testing.assert_allclose([*turn, scale], 0.0, atol=1e-10)


def test_a_block_that_gross_errors_drive_away_from_its_start_is_refused_by_cause(tmp_path: Path) -> None:
    """Two points of an image have each other's number, and all observations are kept."""
    small = flown(2, 4)
    a, b = (("102", small.seen_by("102")[k]) for k in (3, 9))
    small.rays[a], small.rays[b] = small.rays[b], small.rays[a]
    small.control, small.observed = {}, {}
    with pytest.raises(ConvergenceError) as caught:
        adjusted_by("graph", small.write(tmp_path / "b"), datum="free", blunders="none")
    assert "run away from the start values of its datum" in caught.value.what
    assert "exchanged numbers" in caught.value.remedy


def test_a_block_that_cannot_say_what_is_weak_keeps_the_error_of_its_datum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its normal equations may have no factor either."""

    def no_factor(*_: object) -> None:
        raise GeometryError("constraints that depend on each other", remedy="leave one out")

    monkeypatch.setattr(free_datum, "factor_of", no_factor)
    error = ConvergenceError("the block has run away", remedy="start from better values")
    assert (
        free_datum._run_away(cast("Adjusted", SimpleNamespace(factored=None, problem=None, state={})), error) is error
    )


@pytest.mark.slow
def test_a_right_free_block_without_control_is_not_called_weak_where_its_datum_rests_on_one_end(tmp_path: Path) -> None:
    """Standard deviations grow with the distance from four points of the first image: that is what was asked for."""
    small = flown(1, 8, points=30)
    whole = tables(options=TablesOptions(path=small.write(tmp_path / "whole")))
    initial = graph(whole, calibrated(whole), rng=np.random.default_rng(1))
    small.control, small.observed = {}, {}
    block = tables(options=TablesOptions(path=small.write(tmp_path / "free")))
    east_m = np.nan_to_num(initial.points.xyz_m[:, 0], nan=np.inf)
    marked = _marked(whole, np.argsort(east_m)[10:14])
    block = replace(block, ground_points=marked.take(marked.datum))
    told, options = Told(), BundleOptions(datum="free", datum_over="marked")
    solution = bundle(block, calibrated(block), initial, options=options, context=told)
    sigma_m = np.sqrt(np.trace(solution.points.covariance_m2, axis1=1, axis2=2) / 3)
    assert np.nanmax(sigma_m) > 20 * np.nanmin(sigma_m)
    assert not [text for text in told.warnings if text.startswith("hardly determined")]
