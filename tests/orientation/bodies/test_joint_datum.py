"""One similarity from control, positions, distances and attitudes, with their weights and without what is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.rotations import angle_axes
from aatri.geometry.similarity import Similarity, inverse, transform
from aatri.observations import ties
from aatri.observations.geodetic.sights import Sights
from aatri.orientation.bodies.absolute import OrientedComponent, orient_component
from aatri.orientation.bodies.datum import Datum
from aatri.orientation.bodies.given_relations import GivenAttitudes, Lengths

TRUE = Similarity(np.array([500.0, 400.0, 100.0]), 220.0, Rotation.from_rotvec([0.02, -0.03, 2.0]).as_matrix())
BACK = inverse(TRUE)
RNG = np.random.default_rng(12)
BODY = np.column_stack([RNG.uniform(0, 2000, 60), RNG.uniform(0, 1200, 60), RNG.uniform(0, 40, 60)])
UP = TRUE.rotation.T @ [0.02, 0.01, 1.0]
GROUND = np.array([[0.0, 0, 10], [2000, 0, 20], [0, 1200, 30], [2000, 1200, 15], [900, 500, 400], [1100, 700, 410]])
ENDS = np.array([[200.0, 300, 12], [1500, 900, 25], [1800, 200, 8]])
SIGMA_X, SIGMA_GIVEN, SIGMA_D = 0.02, 0.05, 0.01
OF_POINTS = np.eye(3)[None] * (SIGMA_X / 220) ** 2
NAMES = np.array(list("abcde"))
START, END = np.array([[0, 6, 7, 1, 2], [6, 7, 8, 8, 7]], dtype=np.int32)


def datum_with(rng: np.random.Generator, *, given: int = 6, distances: bool = True, wrong_m: float = 0.0) -> Datum:
    """Control points, positions, and further points that distances reach; all with normal errors."""
    places = np.concatenate([GROUND, ENDS])
    n = len(places)
    x = transform(BACK, places + rng.normal(0, SIGMA_X, places.shape))
    value = np.linalg.norm(places[END] - places[START], axis=1) + rng.normal(0, SIGMA_D, len(START))
    value[1] += wrong_m
    no, zero, none = np.zeros(5, dtype=bool), np.zeros(5), np.full(5, "")
    sights = Sights(np.arange(5), START, END, no, no, zero, zero, value, np.full(5, SIGMA_D), NAMES, none, none, none)
    length = Lengths("distance", sights, no)
    known = np.zeros((n, 3), dtype=bool)
    known[:given] = True
    return Datum(
        name=tuple(f"point {k}" for k in range(n)),
        x=x,
        covariance=OF_POINTS.repeat(n, 0),
        offset_m=np.zeros((n, 3)),
        xyz_m=np.where(known, places + rng.normal(0, SIGMA_GIVEN, places.shape), 0.0),
        covariance_m2=np.tile(np.eye(3) * SIGMA_GIVEN**2, (n, 1, 1)),
        given=known,
        n_control=4,
        n_given=6,
        distances=(length,) if distances else (),
    )


def oriented(datum: Datum) -> OrientedComponent:
    return orient_component(datum, transform(BACK, BODY), UP, what="component 1", stiff=True)


def by_scipy(datum: Datum, start: Similarity, tau_m: float) -> Similarity:
    """The same least squares, ground points as unknowns, by another program."""
    n, d = len(datum.x), datum.distances[0].sights
    sigma_x = np.hypot(start.scale * SIGMA_X / 220, tau_m)

    def similarity(p: np.ndarray) -> Similarity:
        turn = Rotation.from_rotvec(p[3:6]).as_matrix()
        return Similarity(start.translation + p[:3], start.scale * np.exp(p[6]), turn @ start.rotation)

    def residuals(p: np.ndarray) -> np.ndarray:
        X = p[7:].reshape(n, 3)
        parts = [
            (X - transform(similarity(p), datum.x)) / sigma_x,
            ((X - datum.xyz_m) / SIGMA_GIVEN)[:6],
            (np.linalg.norm(X[d.target] - X[d.station], axis=1) - d.value) / SIGMA_D,
        ]
        return np.concatenate([part.ravel() for part in parts])

    p0 = np.concatenate([np.zeros(7), transform(start, datum.x).ravel()])
    found = least_squares(residuals, p0, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-12)
    return similarity(found.x)


def off_m(found: Similarity, other: Similarity) -> float:
    x = transform(BACK, BODY)
    return float(np.abs(transform(found, x) - transform(other, x)).max())


def test_control_positions_and_distances_are_adjusted_together_with_their_weights() -> None:
    datum = datum_with(np.random.default_rng(3))
    found = oriented(datum)
    assert found.active.all()
    expected = by_scipy(datum, found.ground_from_component, found.tied.tau_m)
    assert off_m(found.ground_from_component, expected) < 1e-5  # of standard deviations of 1 cm and more
    without = oriented(datum_with(np.random.default_rng(3), distances=False))
    assert off_m(without.ground_from_component, expected) > 1e-3  # the distances do count


def test_a_wrong_distance_is_found_and_does_not_move_the_datum() -> None:
    datum = datum_with(np.random.default_rng(3), wrong_m=1.0)
    found = oriented(datum)
    of_distances = found.tied.active[len(datum.x) + 6 :]
    assert of_distances.tolist() == [True, False, True, True, True]
    assert off_m(found.ground_from_component, TRUE) < 0.15


def test_a_wrong_control_point_is_found_by_distances_and_the_others() -> None:
    datum = datum_with(np.random.default_rng(3))
    datum.xyz_m[1] += [0.0, 3.0, 0.0]
    found = oriented(datum)
    assert found.active.tolist() == [True, False, True, True, True, True]
    assert off_m(found.ground_from_component, TRUE) < 0.15


def attitudes(rng: np.random.Generator, n: int = 8, sigma_rad: float = 1e-4) -> GivenAttitudes:
    """Attitudes of images as omega, phi, kappa."""
    R = Rotation.from_rotvec(rng.normal(0, 0.1, (n, 3))).as_matrix()
    angles = Rotation.from_matrix(R).as_euler("XYZ") + rng.normal(0, sigma_rad, (n, 3))
    observed, turning = angle_axes(angles, "omega-phi-kappa")
    row = np.arange(n)
    return GivenAttitudes(
        "attitude",
        row,
        row.astype(np.str_),
        TRUE.rotation.T @ R,
        observed,
        turning,
        np.tile(np.eye(3) * sigma_rad**2, (n, 1, 1)),
    )


def on_a_line(rng: np.random.Generator) -> Datum:
    """Positions along one strip: the rotation about it is open."""
    places = np.column_stack([np.linspace(0, 2000, 9), np.full(9, 600.0), np.full(9, 500.0)])
    x = transform(BACK, places + rng.normal(0, SIGMA_X, places.shape))
    return Datum(
        name=tuple(f"image {k}" for k in range(9)),
        x=x,
        covariance=OF_POINTS.repeat(9, 0),
        offset_m=np.zeros((9, 3)),
        xyz_m=places,
        covariance_m2=np.tile(np.eye(3) * 0.05**2, (9, 1, 1)),
        given=np.ones((9, 3), dtype=bool),
        n_control=0,
    )


def test_attitudes_give_the_rotation_that_positions_on_a_line_leave_open() -> None:
    rng = np.random.default_rng(8)
    datum = on_a_line(rng)
    with pytest.raises(GeometryError, match="rotation about the line"):
        oriented(datum)
    found = oriented(replace(datum, attitudes=attitudes(rng)))
    turn = Rotation.from_matrix(found.ground_from_component.rotation @ TRUE.rotation.T).magnitude()
    assert turn < 4 * 1e-4 / np.sqrt(8)
    assert off_m(found.ground_from_component, TRUE) < 0.3


def test_a_wrong_attitude_is_found() -> None:
    rng = np.random.default_rng(8)
    given = attitudes(rng)
    given.observed_rotation[2] = Rotation.from_rotvec([0.05, 0, 0]).as_matrix() @ given.observed_rotation[2]
    found = oriented(replace(on_a_line(rng), attitudes=given))
    assert found.tied.active[18:].tolist() == [True, True, False, True, True, True, True, True]


def test_one_known_point_distances_and_attitudes_are_enough() -> None:
    rng = np.random.default_rng(5)
    datum = datum_with(rng)
    one = np.zeros_like(datum.given)
    one[0] = True
    found = oriented(replace(datum, given=one, attitudes=attitudes(rng)))
    assert abs(found.ground_from_component.scale / 220.0 - 1) < 1e-4
    assert off_m(found.ground_from_component, TRUE) < 0.5


def test_derivatives_of_attitudes_are_exact() -> None:
    rng = np.random.default_rng(6)
    a = attitudes(rng, 4, 1e-2)
    similarity = Rotation.from_rotvec([0.3, 0.2, 2.2]).as_matrix()

    class Poses:
        rotation = similarity[None]

    v, (J,) = a.observed().records.evaluate({ties.BODY: Poses}, np.arange(4))
    h = 1e-6
    for axis in range(3):
        step = Rotation.from_rotvec(h * np.eye(3)[axis]).as_matrix()

        class Turned:
            rotation = (step @ similarity)[None]

        changed, _ = a.observed().records.evaluate({ties.BODY: Turned}, np.arange(4))
        np.testing.assert_allclose(J[:, :, 3 + axis], (changed - v) / h, atol=1e-4)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_wrong_position_is_found_among_few_others(axis: int) -> None:
    datum = datum_with(np.random.default_rng(4), distances=False)
    datum.xyz_m[5, axis] += 2.0
    found = oriented(datum)
    assert found.active.tolist() == [True, True, True, True, True, False]
    assert off_m(found.ground_from_component, TRUE) < 0.15


def test_control_that_disagrees_smoothly_is_a_deformation_and_no_gross_error() -> None:
    datum = datum_with(np.random.default_rng(4), distances=False)
    bend = 2e-7 * ((datum.xyz_m[:6, :2] - [1000, 600]) ** 2).sum(axis=1)
    datum.xyz_m[:6, 2] += 2.0 * bend
    found = oriented(datum)
    assert found.active.all()
    assert found.tied.tau_m > 0.05
