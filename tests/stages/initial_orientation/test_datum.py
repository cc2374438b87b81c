"""Control, positions, distances and attitudes of images of any arrangement, right and wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.adapters.ground.initial_solution import left_out_table
from aatri.artifacts.block import CONTROL, Block, Geodetic
from aatri.artifacts.solution import Solution
from aatri.observations.carried_vectors import velocities
from aatri.observations.control import Control, observed_control
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation.unordered import SMALL_UAV, far_off, initial_of, simulated, without_strips


def with_distances(block: Block, ends: np.ndarray, wrong_m: float = 0.0) -> Block:
    """True distances between points, of 5 mm; the second one wrong."""
    true = block.true_points
    assert true is not None
    value = np.linalg.norm(true.xyz_m[ends[:, 1]] - true.xyz_m[ends[:, 0]], axis=1)
    value[1] += wrong_m
    n, ids = len(ends), block.points.id
    text, nan = np.full(n, ""), np.full(n, np.nan)
    geodetic = Geodetic(
        type=np.full(n, "distance"),
        start=ids[ends[:, 0]],
        end=ids[ends[:, 1]],
        via=text,
        start_kind=np.full(n, "point"),
        end_kind=np.full(n, "point"),
        value=value,
        sigma=np.full(n, 0.005),
        set=text,
        group=text,
        start_height_m=nan,
        end_height_m=nan,
        active=np.ones(n, dtype=bool),
        reduced=np.full(n, "no"),
        file=np.full(n, -1),
        line=np.full(n, -1),
    )
    return replace(block, geodetic=geodetic)


def some_ends(block: Block, n: int) -> np.ndarray:
    """Pairs of points that many images see, far apart."""
    m = block.image_points
    seen = np.flatnonzero(np.bincount(m.point, minlength=len(block.points)) >= 6)
    seen = seen[~np.isin(seen, block.ground_points.point)]
    chosen = seen[np.linspace(0, len(seen) - 1, 2 * n).astype(int)]
    return np.column_stack([chosen[:n], chosen[n:]])


def rejected_of(found: Solution, kind: str) -> list[str]:
    s = found.suspects
    of = (s.kind == kind) & (s.verdict == "rejected") & (s.stage == "initial_orientation")
    return [a or b for a, b in zip(s.point[of].tolist(), s.image[of].tolist())]


@pytest.mark.slow
def test_positions_of_wrong_images_are_rejected_by_name() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    exterior = block.exterior
    image = exterior.image.copy()
    image[[2, 20]] = image[[20, 2]]
    order = np.argsort(image)
    found = initial_of(replace(block, exterior=replace(exterior, image=image).take(order)), pairs_per_image=6)
    wrong = found.suspects.image[(found.suspects.kind == "position") & (found.suspects.verdict == "rejected")]
    assert sorted(wrong.tolist()) == sorted(block.images.id[[2, 20]].tolist())
    assert far_off(block, found)[0] < 0.2


def test_positions_of_another_exposure_time_are_no_deformation_as_the_bundle_estimates_or_tests_it() -> None:
    """Two strips flown to and fro, images 2 s apart, positions of 0.05 s later."""
    block = simulated(**{**SMALL_UAV, "flight": {"strips": 2, "images_per_strip": 6}})
    images, e = block.images, block.exterior
    order = np.arange(len(images))
    timed = replace(block, images=replace(images, time_s=1000.0 * images.strip + 2.0 * order))
    along = velocities(timed, e.image, e.position_m)
    later, told = replace(e, position_m=e.position_m + 0.05 * along), Told()
    found = initial_of(replace(timed, exterior=later), told)
    assert not [text for text in told.warnings if "fit it only with" in text]
    assert not rejected_of(found, "position")
    assert far_off(block, found)[0] < 0.2 < 0.05 * float(np.linalg.norm(along, axis=1).min())


def test_without_control_and_positions_distances_give_the_scale() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    none = np.zeros(0, dtype=np.intp)
    true = block.true_points
    assert true is not None
    a, b = block.ground_points.point[:2]
    value = float(np.linalg.norm(true.xyz_m[a] - true.xyz_m[b]))
    ends = {"start": np.array([block.points.id[a]]), "end": np.array([block.points.id[b]])}
    distance = Geodetic(
        type=np.array(["distance"]),
        **ends,
        via=np.array([""]),
        start_kind=np.array(["point"]),
        end_kind=np.array(["point"]),
        value=np.array([value]),
        sigma=np.array([0.01]),
        set=np.array([""]),
        group=np.array([""]),
        start_height_m=np.array([np.nan]),
        end_height_m=np.array([np.nan]),
        active=np.array([True]),
        reduced=np.array(["no"]),
        file=np.array([-1]),
        line=np.array([-1]),
    )
    bare = replace(
        block, ground_points=block.ground_points.take(none), exterior=block.exterior.take(none), geodetic=distance
    )
    found = initial_of(bare, pairs_per_image=6)
    assert found.datum is not None
    xyz = found.points.xyz_m
    assert np.linalg.norm(xyz[a] - xyz[b]) == pytest.approx(value, rel=1e-9)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("wrong_m", [0.5, 1e5])
def test_a_wrong_distance_is_named_and_does_not_spoil_the_datum(wrong_m: float) -> None:
    block = without_strips(simulated(**SMALL_UAV))
    block = with_distances(block, some_ends(block, 4), wrong_m=wrong_m)
    found = initial_of(block, pairs_per_image=6)
    g = block.geodetic
    assert rejected_of(found, "distance") == [f"{g.start[1]}-{g.end[1]}"]
    assert far_off(block, found)[0] < 0.2
    assert (found.residuals.kind == "distance").sum() == 4


def test_a_wrong_distance_is_named_where_distances_alone_give_the_scale() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    none = np.zeros(0, dtype=np.intp)
    bare = replace(block, ground_points=block.ground_points.take(none), exterior=block.exterior.take(none))
    bare = with_distances(bare, some_ends(block, 4), wrong_m=5.0)
    found = initial_of(bare, pairs_per_image=6)
    g = bare.geodetic
    assert rejected_of(found, "distance") == [f"{g.start[1]}-{g.end[1]}"]
    true, xyz, (a, b) = block.true_points, found.points.xyz_m, some_ends(block, 4)[3]
    assert true is not None
    ratio = np.linalg.norm(xyz[a] - xyz[b]) / np.linalg.norm(true.xyz_m[a] - true.xyz_m[b])
    assert ratio == pytest.approx(1.0, abs=1e-3)  # the points are known to a few centimetres in 19 m


@pytest.mark.slow
def test_a_wrong_control_point_is_named_and_does_not_spoil_the_datum() -> None:
    block = without_strips(simulated(**SMALL_UAV, gnss={"observed": False, "approximate_positions": False}))
    row, wrong = int(np.flatnonzero(block.ground_points.role[:, 0] == CONTROL)[2]), block.ground_points.xyz_m.copy()
    wrong[row, 0] += 3.0
    block = replace(block, ground_points=replace(block.ground_points, xyz_m=wrong))
    found = initial_of(block, pairs_per_image=6)
    assert rejected_of(found, "control") == [str(block.points.id[block.ground_points.point[row]])]
    assert far_off(block, found)[0] < 0.3


@pytest.mark.slow
def test_attitudes_turn_a_free_datum_and_bring_what_positions_of_one_strip_leave_open() -> None:
    one = {**SMALL_UAV, "flight": {"strips": 1, "images_per_strip": 8}, "imu": {"observed": True}}
    block = without_strips(simulated(**one))
    block = replace(block, ground_points=block.ground_points.take(np.zeros(0, dtype=np.intp)))
    found = initial_of(block)
    assert found.datum is None
    assert found.images.oriented.all()
    metres, radians = far_off(block, found)
    assert metres < 0.3
    assert radians < 1e-3
    angles = replace(block.exterior, position_m=np.full_like(block.exterior.position_m, np.nan))
    free = initial_of(replace(block, exterior=angles))
    assert free.datum is not None
    true = block.true_images
    assert true is not None
    turned = free.images.ground_from_image @ true.ground_from_image.swapaxes(1, 2)
    assert Rotation.from_matrix(turned).magnitude().max() < 2e-3


def test_distances_from_images_with_heights_and_in_plan_fit_what_they_were_made_from() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    images, points = block.true_images, block.true_points
    assert images is not None
    assert points is not None
    (a, b), (c, d) = some_ends(block, 2)
    line = points.xyz_m[b] - points.xyz_m[a] + [0.0, 0.0, 1.5 - 1.7]  # from the instrument to the target
    to_image = images.position_m[5] - points.xyz_m[c]
    value = [np.linalg.norm(line), np.linalg.norm(line[:2]), np.linalg.norm(to_image)]
    block = with_distances(block, np.array([[a, b], [a, b], [c, d]]))
    geodetic = replace(
        block.geodetic,
        type=np.array(["distance", "horizontal_distance", "distance"]),
        value=np.array(value),
        end=np.array([*block.geodetic.end[:2], str(block.images.id[5])]),
        end_kind=np.array(["point", "point", "image"]),
        start_height_m=np.array([1.7, 1.7, np.nan]),
        end_height_m=np.array([1.5, 1.5, np.nan]),
    )
    found = initial_of(replace(block, geodetic=geodetic), pairs_per_image=6)
    of = np.isin(found.residuals.kind, ["distance", "horizontal_distance"])
    assert sorted(found.residuals.kind[of].tolist()) == ["distance", "distance", "horizontal_distance"]
    assert found.residuals.active[of].all()
    assert np.abs(found.residuals.residual[of, 0]).max() < 0.15


def test_what_is_left_out_has_the_mean_square_of_its_residuals_in_standard_deviations() -> None:
    """By hand: (3, 4, 0) m with 0.5, 1 and 2 m is 6, 4 and 0 sigma, 5 m long; a missing height does not count."""
    rows, every = np.arange(2, dtype=np.int32), np.ones((2, 3), dtype=bool)
    covariance = np.broadcast_to(np.diag([0.25, 1.0, 4.0]), (2, 3, 3)).copy()
    control = Control(rows, rows, np.zeros((2, 3)), covariance, every, ~every)
    (observed,) = observed_control(control, np.zeros(3), np.array(["a", "b"]))
    table = left_out_table(observed, np.array([[3.0, 4.0, 0.0], [3.0, 4.0, np.nan]]))
    np.testing.assert_allclose(table.size, [5.0, 5.0])
    np.testing.assert_allclose(table.test, np.sqrt([52.0 / 3.0, 52.0 / 2.0]))
    np.testing.assert_allclose(table.sigma, table.size / table.test)
