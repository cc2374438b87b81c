"""What nobody can see before the bundle is listed: errors put there show nowhere, errors elsewhere do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.adapters.observation_tables import _along
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.model_adjustment.independent_models import independent_models
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated

SIZE = 40.0
"""Gross errors, in standard deviations of an image coordinate."""


def block_of(known: dict[str, int], per_position: int = 3) -> Any:
    return simulated(
        4,
        camera={"kind": "digital", "format": (9000.0, 9000.0), "pixel_size_mm": 0.02},
        known=known,
        flight={"strips": 2, "images_per_strip": 4},
        ties={"per_position": per_position},
        refraction="none",
        gnss={"observed": False},
    )


def before_the_bundle(block: Any, points: Any) -> tuple[Any, ...]:
    models = dependent(block, points)
    strips = scale_transfer(block, models)
    absolute = similarity(block, strips, points)
    return (
        models,
        strips,
        absolute,
        polynomial(block, points, strips, absolute),
        independent_models(block, points, models, absolute),
    )


@pytest.fixture(scope="module")
def made() -> tuple[Any, Any, tuple[Any, ...]]:
    block = block_of({"full": 8})
    points = systematic(block, calibrated(block))
    return block, points, before_the_bundle(block, points)


def moved(points: Any, row: int, by_mm: np.ndarray) -> Any:
    xy = points.measurements.xy_mm.copy()
    xy[row] += by_mm
    return replace(points, measurements=replace(points.measurements, xy_mm=xy))


def out(artifact: Any) -> set[tuple[str, str]]:
    s = artifact.suspects.take(artifact.suspects.staying_out)
    return set(zip(s.kind.tolist(), s.point.tolist()))


def test_an_error_along_a_listed_direction_shows_in_no_stage(made: Any) -> None:
    block, points, stages = made
    listed = stages[3].uncontrolled
    k = int(np.flatnonzero((listed.kind == "image_point") & np.isfinite(listed.direction[:, 0]))[0])
    sigma = float(points.measurements.sigma_mm[listed.row[k], 0])
    after = before_the_bundle(block, moved(points, int(listed.row[k]), SIZE * sigma * listed.direction[k, :2]))
    for clean, spoilt in zip(stages, after):
        assert out(spoilt) == out(clean)
        point = str(listed.point[k])
        assert point in spoilt.uncontrolled.point


def test_a_listed_direction_is_the_unit_vector_along_the_epipolar_line(made: Any) -> None:
    base, ray = np.array([[0.5, 0.1, 0.05]]), np.array([[0.3, -0.4, -1.0]])
    further = ray + 1e-6 * base
    moved_to = further[:, :2] / further[:, 2:] - ray[:, :2] / ray[:, 2:]
    along = _along(base, ray)
    np.testing.assert_allclose(np.abs((along * moved_to).sum()), np.linalg.norm(moved_to), rtol=1e-5)
    for base_and_ray in ((base, ray), (base, 2.0 * base)):  # the ray along the base: any direction
        np.testing.assert_allclose(np.linalg.norm(_along(*base_and_ray)), 1.0)


def test_an_error_of_x_that_another_model_sees_is_found_and_not_listed(made: Any) -> None:
    block, points, stages = made
    tied = stages[1].strip_points
    point = int(tied.point[np.flatnonzero(tied.models == 2)[0]])
    name = str(block.points.id[point])
    mine = np.flatnonzero(points.measurements.point == point)
    assert all(name not in s.uncontrolled.point for s in stages)
    after = before_the_bundle(block, moved(points, int(mine[0]), np.array([SIZE * 0.005, 0.0])))
    assert any(p == name for s in after for _, p in out(s))


def test_every_image_point_of_one_model_is_listed_once_with_its_row(made: Any) -> None:
    block, _, (models, *_) = made
    p, o, u = models.model_points, models.orientations, models.uncontrolled
    u = u.take(np.isfinite(u.direction[:, 0]))
    counts = np.bincount(p.point[p.active], minlength=len(block.points))
    rows = np.flatnonzero(p.active & (counts[p.point] == 1))
    wanted = {
        (str(block.images.id[i]), str(block.points.id[p.point[r]]))
        for r in rows
        for i in (o.left[p.model[r]], o.right[p.model[r]])
    }
    listed = list(zip(u.image.tolist(), u.point.tolist()))
    assert sorted(listed) == sorted(wanted)
    m = block.image_points
    assert [(str(block.images.id[m.image[r]]), str(block.points.id[m.point[r]])) for r in u.row] == listed
    assert np.hypot(*u.direction[:, :2].T) == pytest.approx(np.ones(len(u)), abs=1e-12)


@pytest.mark.slow
def test_a_ray_in_no_model_is_listed_by_every_stage_without_direction_and_its_error_shows_nowhere(made: Any) -> None:
    block, points, clean = made
    m = points.measurements
    strip, place = block.images.strip[m.image], block.images.sequence[m.image]
    two = next(  # a point in two images of one strip, and in the other strip
        p
        for p in range(len(block.points))
        if (strip[m.point == p] == 0).sum() == 2 and (strip[m.point == p] == 1).sum() > 1
    )
    rows = np.flatnonzero((m.point == two) & (strip == 0))
    active = m.active.copy()
    active[rows[0]] = False
    alone = replace(points, measurements=replace(m, active=active))
    wanted = set()
    for row in np.flatnonzero(active):
        others = active & (m.point == m.point[row]) & (strip == strip[row]) & (np.abs(place - place[row]) == 1)
        if not others.any():
            wanted.add(row)
    assert rows[1] in wanted
    before, after = (before_the_bundle(block, p) for p in (alone, moved(alone, int(rows[1]), np.array([0.2, 0.2]))))
    for one, spoilt in zip(before, after):
        u = one.uncontrolled
        nothing = u.take((u.kind == "image_point") & np.isnan(u.direction).all(axis=1))
        assert set(nothing.row.tolist()) == wanted
        assert out(spoilt) == out(one)
    assert len(clean[0].uncontrolled)


def test_five_points_control_no_parallax() -> None:
    """Redundancy 0: across the base as well."""
    block = block_of({"full": 8})
    image = block.image_points
    keep = np.ones(len(image), dtype=bool)
    first = [np.flatnonzero(block.images.id[image.image] == i) for i in block.images.id[:2]]
    common = np.intersect1d(*(image.point[rows] for rows in first))
    keep[first[0]] = np.isin(image.point[first[0]], common[[0, 2, 4, 6, 8]])
    block = replace(block, image_points=replace(image, active=image.active & keep))
    models = dependent(block, systematic(block, calibrated(block)))
    assert models.orientations.redundancy[0] == 0
    listed = models.uncontrolled
    across = np.abs(listed.direction[:, 1]) > 0.9
    assert np.unique(listed.image[across]).tolist() == block.images.id[:2].tolist()
    assert len(np.unique(listed.point[across])) == 5
    assert listed.redundancy[across] == pytest.approx(np.zeros(10), abs=1e-12)


@pytest.mark.slow
def test_control_without_redundancy_is_listed_and_control_of_twice_as_many_points_is_not(made: Any) -> None:
    few = block_of({"full": 2, "height": 1})
    points = systematic(few, calibrated(few))
    strips = scale_transfer(few, dependent(few, points))
    listed = similarity(few, strips, points).uncontrolled
    control = listed.take(listed.kind == "control")
    assert len(np.unique(control.point)) == 3
    assert control.redundancy == pytest.approx(np.zeros(len(control)), abs=1e-6)
    many = made[2][2].uncontrolled
    assert not (many.kind == "control").any()
