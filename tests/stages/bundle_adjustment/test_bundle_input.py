"""What the bundle takes from a block and gives back, on a block whose every number is known beforehand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.hand_block import (
    ANGLES_RAD,
    PRINCIPAL_POINT_MM,
    Hand,
    Heard,
    angles_deg,
    ground_rows,
    hand,
    projected,
    read,
    start,
)

OF = hand()
CORNERS = (0, 5, 24, 29)
MAP = (5e5, 5e6, 300.0)
EXACT = {"tail": ",0,0,0", "head": ",sX,sY,sZ"}


NO_SEARCH = BundleOptions(blunders="none")


def exterior_rows(of: Hand, angles: object, position: object = None, tail: str = "", head: str = "") -> str:
    """exterior.csv with positions and angles; None leaves the cells empty."""
    rows = []
    for k, name in enumerate(of.image_ids):
        xyz = [repr(v) for v in (of.position_m if position is None else position)[k].tolist()]
        turns = ["", "", ""] if angles is None else [repr(v) for v in angles[k].tolist()]
        rows.append(",".join([name, *xyz, *turns]) + tail)
    return "\n".join([f"image,X,Y,Z,a1,a2,a3{head}", *rows]) + "\n"


def assert_is_the_block(found: Solution, of: Hand, tolerance_m: float = 1e-6) -> None:
    np.testing.assert_allclose(found.images.position_m, of.position_m, rtol=0, atol=tolerance_m)
    np.testing.assert_allclose(found.images.ground_from_image, of.rotation, rtol=0, atol=tolerance_m / 100)
    np.testing.assert_allclose(found.points.xyz_m, of.xyz_m, rtol=0, atol=tolerance_m)


def rows_of(found: Solution, kind: str) -> np.ndarray:
    return np.flatnonzero((found.residuals.kind == kind) & found.residuals.active)


@pytest.mark.parametrize("system", ["omega-phi-kappa", "phi-omega-kappa"])
@pytest.mark.parametrize("origin_m", [(0.0, 0.0, 0.0), MAP], ids=["near", "map"])
def test_given_orientations_start_where_the_images_are(tmp_path: Path, system: str, origin_m: tuple) -> None:
    of = hand(origin_m)
    exterior = exterior_rows(of, angles_deg(of, system))
    block, points = read(tmp_path, of, ground=ground_rows(of, CORNERS), exterior=exterior, rotation=system)
    found = bundle(block, points)
    assert_is_the_block(found, of)
    assert found.history.cost[0] < 1e-6  # the start fits already: it is the one that was given
    assert found.images.oriented.all()


def test_the_written_angles_are_those_of_both_systems() -> None:
    """The help of this test itself: by hand, for small angles both systems agree but for the sign of phi."""
    assert angles_deg(OF, "omega-phi-kappa") == pytest.approx(np.degrees(ANGLES_RAD))
    np.testing.assert_allclose(angles_deg(OF, "phi-omega-kappa")[:, 0], -np.degrees(ANGLES_RAD)[:, 1], atol=0.5)


def test_a_given_antenna_starts_the_projection_centre_at_the_other_end_of_its_arm(tmp_path: Path) -> None:
    arm = np.array([1.5, -2.0, 3.0])
    antenna = OF.position_m + OF.rotation @ arm
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), antenna, ",antenna", ",refers_to")
    block, points = read(
        tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior=exterior, camera={"lever_arm": arm.tolist()}
    )
    found = bundle(block, points)
    assert found.history.cost[0] < 1e-6
    assert len(rows_of(found, "position")) == 0  # approximate, not observed


def test_positions_of_antennas_are_a_datum_by_themselves(tmp_path: Path) -> None:
    arm = np.array([1.5, -2.0, 3.0])
    antenna = OF.position_m + OF.rotation @ arm
    exterior = exterior_rows(
        OF, angles_deg(OF, "omega-phi-kappa"), antenna, ",0.001,0.001,0.001,antenna", ",sX,sY,sZ,refers_to"
    )
    block, points = read(tmp_path, OF, exterior=exterior, camera={"lever_arm": arm.tolist()})
    shifted = start(OF, block, position_m=OF.position_m + np.array([0.5, -0.2, 0.3]))
    found = bundle(block, points, shifted)
    assert_is_the_block(found, OF)
    mine = rows_of(found, "position")
    assert found.residuals.image[mine].tolist() == OF.image_ids
    np.testing.assert_allclose(found.residuals.residual[mine], 0.0, atol=1e-6)
    np.testing.assert_allclose(found.residuals.sigma[mine], 0.001)
    assert found.observations == 2 * len(OF.image) + 18


def test_a_position_that_is_wrong_shows_its_error_with_its_sign_and_its_row(tmp_path: Path) -> None:
    wrong = OF.position_m.copy()
    wrong[4] += [0.5, -0.3, 0.2]
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), wrong, ",50,60,70", ",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS, **EXACT), exterior=exterior)
    found = bundle(block, points, options=BundleOptions(reliability=True))
    mine = rows_of(found, "position")
    residual, sigma = found.residuals.residual[mine[4]], found.residuals.sigma[mine[4]]
    np.testing.assert_allclose(residual, [-0.5, 0.3, -0.2], atol=1e-4)  # adjusted minus observed
    assert sigma.tolist() == [50.0, 60.0, 70.0]
    assert found.residuals.row[mine[4]] == 4
    assert found.residuals.image[mine[4]] == "i4"
    assert found.tests is not None
    np.testing.assert_allclose(found.tests.redundancy[mine], 1.0, atol=1e-4)  # so weak that the rays decide
    np.testing.assert_allclose(found.tests.test[mine[4]], residual / sigma, rtol=1e-3)
    # a gross error of (3.29 + 0.84) sigma is found with 80 % at a level of 0.1 %
    np.testing.assert_allclose(found.tests.detectable[mine[4]], 4.13 * sigma, rtol=1e-3)


def test_positions_are_not_used_where_they_are_not_wanted(tmp_path: Path) -> None:
    wrong = OF.position_m + np.array([5.0, 0.0, 0.0])
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"), wrong, ",0.01,0.01,0.01", ",sX,sY,sZ")
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), exterior=exterior)
    found = bundle(block, points, options=BundleOptions(positions={"use": False}))
    assert_is_the_block(found, OF)
    assert len(rows_of(found, "position")) == 0


def test_control_that_is_wrong_shows_its_error_with_its_sign_and_its_row(tmp_path: Path) -> None:
    strong = ground_rows(OF, CORNERS, **EXACT)
    weak = ground_rows(OF, (14,), ",40,50,60", off=[0.3, -0.2, 0.1]).splitlines()[1]
    block, points = read(tmp_path, OF, ground=strong + weak + "\n")
    found = bundle(block, points, start(OF, block), options=BundleOptions(reliability=True))
    row = block.ground_points.point.tolist().index(block.points.id.tolist().index("p14"))
    (mine,) = np.flatnonzero((found.residuals.kind == "control") & (found.residuals.point == "p14"))
    np.testing.assert_allclose(found.residuals.residual[mine], [-0.3, 0.2, -0.1], atol=1e-4)
    assert found.residuals.sigma[mine].tolist() == [40.0, 50.0, 60.0]
    assert found.residuals.row[mine] == row
    assert found.tests is not None
    np.testing.assert_allclose(found.tests.redundancy[mine], 1.0, atol=1e-4)
    np.testing.assert_allclose(found.tests.test[mine], [-0.3 / 40, 0.2 / 50, -0.1 / 60], rtol=1e-3)
    exact = [k for k in rows_of(found, "control") if k != mine]
    assert found.residuals.sigma[exact].tolist() == [[0.0, 0.0, 0.0]] * 4
    np.testing.assert_allclose(found.residuals.residual[exact], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.points.xyz_m[list(CORNERS)], OF.xyz_m[list(CORNERS)], rtol=0, atol=1e-9)


def test_exact_control_is_held_even_where_the_start_is_elsewhere(tmp_path: Path) -> None:
    """All control moved alike: the whole block follows, to the digit."""
    by = np.array([3.0, -2.0, 1.0])
    moved = replace(OF, position_m=OF.position_m + by, xyz_m=OF.xyz_m + by)
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS, **EXACT, off=[3.0, -2.0, 1.0]))
    assert_is_the_block(bundle(block, points, start(OF, block)), moved)


def test_each_coordinate_has_its_own_role(tmp_path: Path) -> None:
    """Check coordinates and start values, wrong by hundreds of metres, change nothing and have no residual."""
    strong = ground_rows(OF, CORNERS, ",", ",role")
    plan = ground_rows(OF, (8,), ",XY:control Z:check", off=[0.0, 0.0, 300.0]).splitlines()[1]
    height = ground_rows(OF, (14,), ",XY:check Z:control", off=[-200.0, 400.0, 0.0]).splitlines()[1]
    check = ground_rows(OF, (15,), ",check", off=500.0).splitlines()[1]
    block, points = read(tmp_path, OF, ground="\n".join([strong.strip(), plan, height, check]) + "\n")
    found = bundle(block, points, start(OF, block))
    assert_is_the_block(found, OF)
    of = dict(
        zip(found.residuals.point[rows_of(found, "control")], found.residuals.residual[rows_of(found, "control")])
    )
    assert np.isfinite(of["p08"]).tolist() == [True, True, False]
    assert np.isfinite(of["p14"]).tolist() == [False, False, True]
    assert "p15" not in of
    assert found.observations == 2 * len(OF.image) + 4 * 3 + 3


def test_film_corrections_are_found_where_fiducials_leave_them_open(tmp_path: Path) -> None:
    """dx = d0 + d1 x + d2 y from the fiducial centre, added to the measurement: the film shrank by it.

    d2 = -d4 would be a turn of the image; of the two the adjustment finds d2 = d4, which is none.
    """
    d = np.array([0.003, 2e-4, 1.5e-4, -0.002, 1.5e-4, 3e-4])
    photo = OF.xy_mm + PRINCIPAL_POINT_MM  # where the fiducials would put it, without the deformation
    A = np.array([[1 + d[1], d[2]], [d[4], 1 + d[5]]])
    measured = np.linalg.solve(A, (photo - d[[0, 3]]).T).T - PRINCIPAL_POINT_MM  # measured + dx(measured) = photo
    some = (OF.image == 4)[:, None]
    exterior = exterior_rows(OF, angles_deg(OF, "omega-phi-kappa"))
    block, points = read(
        tmp_path,
        OF,
        ground=ground_rows(OF, range(30), **EXACT),
        exterior=exterior,
        xy_mm=np.where(some, measured, OF.xy_mm),
    )
    covariance = np.zeros((6, 8, 8))
    covariance[[1, 4]] = np.diag([1e3, 0.01, 0.01, 1e3, 0.01, 0.01, 0.0, 0.0])  # so loose that the rays decide
    order = points.interior.image
    open_film = replace(points, interior=replace(points.interior, covariance=covariance[order]))
    found = bundle(block, open_film, options=BundleOptions(interior_unknowns=True))
    named = {(o, n): v for o, n, v in zip(found.parameters.object, found.parameters.name, found.parameters.value)}
    assert {o for o, _ in named} == {"i1", "i4"}  # the others are known exactly
    values = {o: np.array([v for (image, _), v in named.items() if image == o]) for o in ("i1", "i4")}
    np.testing.assert_allclose(values["i4"], d, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(values["i1"], 0.0, atol=1e-6)
    np.testing.assert_allclose(found.images.position_m, OF.position_m, rtol=0, atol=0.01)
    assert np.isfinite(found.parameters.sigma).all()
    assert found.observations == 2 * len(OF.image) + 12


@pytest.mark.slow
@pytest.mark.parametrize("origin_m", [(0.0, 0.0, 0.0), MAP], ids=["near", "map"])
@pytest.mark.parametrize("with_positions", [True, False])
def test_a_start_far_off_is_left_for_one_by_object_space(tmp_path: Path, origin_m: tuple, with_positions: bool) -> None:
    of = hand(origin_m)
    exterior = exterior_rows(of, None, tail=",0.05,0.05,0.05", head=",sX,sY,sZ") if with_positions else ""
    block, points = read(tmp_path, of, ground=ground_rows(of, (*CORNERS, 14)), exterior=exterior)
    rng = np.random.default_rng(4)
    turn = Rotation.from_rotvec(np.radians(60.0) * np.eye(3)[[0, 1, 2, 0, 1, 2]]).as_matrix()
    far = start(
        of,
        block,
        position_m=of.position_m + rng.normal(0, 200.0, (6, 3)),
        rotation=turn @ of.rotation,
        xyz_m=of.xyz_m + rng.normal(0, 30.0, of.xyz_m.shape),
    )
    heard = Heard()
    found = bundle(block, points, far, context=heard)
    assert any("object space" in line for line in heard.logged)
    assert_is_the_block(found, of)


def test_an_image_that_looks_up_is_turned_over(tmp_path: Path) -> None:
    """Flat ground, no positions: u and -u give the same image point, and only the side tells them apart."""
    of = hand(relief_m=0.0)
    of = replace(of, xy_mm=projected(of.position_m, of.rotation, of.xyz_m, of.image, of.point))
    block, points = read(tmp_path, of, ground=ground_rows(of, CORNERS))
    position, rotation = of.position_m.copy(), of.rotation.copy()
    position[4, 2] *= -1.0  # below the ground, mirrored on it, its axis the other way
    rotation[4] = -np.diag([1.0, 1.0, -1.0]) @ rotation[4]
    mirrored = projected(position, rotation, of.xyz_m, of.image, of.point)
    np.testing.assert_allclose(mirrored, of.xy_mm, atol=1e-9)
    found = bundle(block, points, start(of, block, position_m=position, rotation=rotation))
    assert_is_the_block(found, of)


def test_the_order_of_images_and_points_in_an_initial_solution_is_that_of_the_block(tmp_path: Path) -> None:
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS))
    found = bundle(block, points, start(OF, block))
    assert found.history.cost[0] < 1e-6
    assert found.images.image_points.tolist() == np.bincount(OF.image).tolist()
    assert found.points.rays.tolist() == np.bincount(OF.point).tolist()
    rays = rows_of(found, "image_point")
    assert found.residuals.row[rays].tolist() == list(range(len(OF.image)))
    assert found.residuals.image[rays].tolist() == [f"i{k}" for k in OF.image]
    assert found.residuals.point[rays].tolist() == [f"p{k:02}" for k in OF.point]
    np.testing.assert_allclose(found.residuals.sigma[rays, :2], 0.005)
    assert found.sigma0 == pytest.approx(0.0, abs=1e-4)
    assert found.cameras.principal_distance_mm.tolist() == [100.0]
    assert found.unknowns == 6 * 6 + 3 * 30
    assert found.redundancy == found.observations - found.unknowns


def test_a_misfit_of_an_image_point_has_its_sign_and_its_test(tmp_path: Path) -> None:
    """With all points and all positions held, a ray only turns its image: v = computed - measured, about minus it."""
    measured, row = OF.xy_mm.copy(), 25
    measured[row] += [0.02, -0.03]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, range(30), **EXACT), xy_mm=measured)
    options = BundleOptions(reliability=True, blunders="none")
    found = bundle(block, points, start(OF, block), options=options)
    assert found.tests is not None
    (mine,) = [k for k in rows_of(found, "image_point") if found.residuals.row[k] == row]
    r = found.tests.redundancy[mine, :2]
    np.testing.assert_allclose(found.residuals.residual[mine, :2], -r * [0.02, -0.03], atol=0.004)
    assert found.tests.redundancy[rows_of(found, "image_point"), :2].sum() == pytest.approx(found.redundancy)
    v, sigma = found.residuals.residual[mine, :2], 0.005
    np.testing.assert_allclose(found.tests.test[mine, :2], v / (sigma * np.sqrt(r)), rtol=1e-9)
    np.testing.assert_allclose(found.tests.detectable[mine, :2], 4.13 * sigma / np.sqrt(r), rtol=1e-3)
    assert np.isnan(found.tests.test[mine, 2])
