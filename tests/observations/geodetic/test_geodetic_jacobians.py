"""Geodetic observations on a sphere: values and derivatives against formulas written anew, by complex step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.observations.geodetic.differences import COORDINATE_DIFFERENCE as BASELINE
from aatri.observations.geodetic.differences import coordinate_differences, height_differences
from aatri.observations.geodetic.directions import directions
from aatri.observations.geodetic.distances import DistanceOptions, distances
from aatri.observations.geodetic.zenith_angles import ZenithOptions, zenith_angles
from aatri.observations.level import PLANE, Level
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, POSE, Poses
from tests.complex_step import complex_step
from tests.observations.geodetic import round_earth
from tests.observations.geodetic.made_geodetic import geodetic_block

ABOVE = (1.6, 0.4)
K = 0.2


def _flat_line(a: Any, b: Any, above_a: float, above_b: float) -> Any:
    return b - a + np.array([0, 0, above_b - above_a])


def _s(line: Any) -> Any:
    return np.sqrt(line[0] ** 2 + line[1] ** 2)


FORMULAS = {
    "distance": lambda line: np.sqrt((line**2).sum()),
    "horizontal_distance": _s,
    "direction": lambda line: np.arctan(line[0] / line[1]) - 0.3,
    "azimuth": lambda line: np.arctan(line[0] / line[1]),
}


def _observed(type_: str, level: Level, ends: tuple[str, str]) -> tuple[Observed, ...]:
    block = geodetic_block(type_, ends, ABOVE)
    start = {POINT: np.zeros((3, 3)), POSE: Poses(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))}
    given = ObservationSource(block, None, np.zeros(3), start, level=level)
    kinds = {
        "zenith": lambda g: zenith_angles(g, ZenithOptions(refraction=K)),
        "height_difference": height_differences,
        "dX": coordinate_differences,
        "dY": coordinate_differences,
        "dZ": coordinate_differences,
        "distance": lambda g: distances(g, DistanceOptions()),
        "direction": directions,
        "azimuth": directions,
        "horizontal_distance": lambda g: distances(g, DistanceOptions()),
        "angle": directions,
    }
    return kinds[type_](given)


def _formula(type_: str, curved: bool) -> Any:
    line = round_earth.line if curved else _flat_line
    up = (lambda x: round_earth.axes(x)[2]) if curved else (lambda _: np.array([0.0, 0.0, 1.0]))
    height = round_earth.height if curved else (lambda x: x[2])

    def f(z: Any) -> Any:
        a, b = z[:3], z[3:6]
        if type_ == "zenith":
            found = line(a, b, *ABOVE)
            bent = -K / 2 / round_earth.R if curved else 0.0
            return np.arctan(_s(found) / found[2]) + bent * _s(found)
        if type_ == "height_difference":
            return height(b) + ABOVE[1] - height(a) - ABOVE[0]
        if type_ in ("dX", "dY", "dZ"):
            return (b + ABOVE[1] * up(b) - a - ABOVE[0] * up(a))["XYZ".index(type_[1])]
        if type_ == "angle":  # at the third point, from the first to the second
            one, two = line(z[6:], a, 0.0, ABOVE[0]), line(z[6:], b, 0.0, ABOVE[1])
            return np.arctan(two[0] / two[1]) - np.arctan(one[0] / one[1])
        return FORMULAS[type_](line(a, b, *ABOVE))

    return lambda z: np.asarray(f(z))[None]


TYPES = (
    "distance",
    "horizontal_distance",
    "direction",
    "azimuth",
    "angle",
    "zenith",
    "height_difference",
    "dX",
    "dY",
    "dZ",
)


@pytest.mark.parametrize("ends", [("point", "point"), ("point", "image"), ("image", "point"), ("image", "image")])
@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("type_", TYPES)
def test_values_and_derivatives(type_: str, curved: bool, ends: tuple[str, str]) -> None:
    rng = np.random.default_rng(8)
    points, centres = rng.normal(0, 900, (3, 3)), rng.normal(0, 900, (2, 3))
    points[:, 2] /= 9
    (o,) = _observed(type_, round_earth.ROUND if curved else PLANE, ends)
    state = {POINT: points, POSE: Poses(centres, np.tile(np.eye(3), (2, 1, 1))), **o.start}
    if type_ == "direction":
        state["orientation"] = np.array([[0.3]])
    v, J = o.records.evaluate(state, np.arange(1))
    z = np.concatenate(
        [
            (centres if ends[0] == "image" else points)[0],
            (centres if ends[1] == "image" else points)[1],
            *([points[2]] if type_ == "angle" else []),
        ]
    )
    f = _formula(type_, curved)
    observed = 0.5 if o.unit == "rad" else 100.0
    turns = (v[0] - (f(z) - observed)) / np.pi if o.unit == "rad" else v[0] - (f(z) - observed)
    np.testing.assert_allclose(turns - np.round(turns) if o.unit == "rad" else turns, 0.0, atol=3e-9)
    J = [j[0][:, :3] for j in J if j.shape[2] != 1]
    J = [*J[1:], J[0]] if type_ == "angle" else J  # records touch the vertex first
    expected = complex_step(f, z)
    np.testing.assert_allclose(np.hstack(J) / np.abs(expected).max(), expected / np.abs(expected).max(), atol=1e-10)
    assert o.kind == (BASELINE if type_.startswith("d") and len(type_) == 2 else type_)


def test_scale_addition_and_orientation_are_unknowns_with_their_derivatives() -> None:
    (o,) = _observed("distance", PLANE, ("point", "point"))
    assert not o.unknowns
    block = geodetic_block("distance", ("point", "point"), (0.0, 0.0), group="edm")
    start = {POINT: np.zeros((3, 3)), POSE: Poses(np.zeros((0, 3)), np.zeros((0, 3, 3)))}
    (o,) = distances(ObservationSource(block, None, np.zeros(3), start), DistanceOptions())
    points = np.array([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0], [0.0, 0.0, 0.0]])
    v, J = o.records.evaluate({POINT: points, "distance_group": np.array([[2e-4, 0.03]])}, np.arange(1))
    assert v[0, 0] == pytest.approx(50 * (1 + 2e-4) + 0.03 - 100.0)
    np.testing.assert_allclose(J[2][0], [[50.0, 1.0]])
    np.testing.assert_allclose(J[1][0], [[0.6 * 1.0002, 0.8 * 1.0002, 0.0]])


def test_directions_carry_the_orientation_of_their_set() -> None:
    (o,) = _observed("direction", PLANE, ("point", "point"))
    state = {POINT: np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), "orientation": np.array([[0.25]])}
    v, J = o.records.evaluate(state, np.arange(1))
    assert v[0, 0] == pytest.approx(np.pi / 2 - 0.25 - 0.5)
    np.testing.assert_allclose(J[2][0], [[-1.0]])


def test_what_a_local_frame_neglects_of_a_zenith_angle_is_told_by_its_size() -> None:
    """k = 0.13 over 2 km: (1 - k) s / 2 R = 0.000136560 rad = 28.2", R = 6,371 km, beside a sigma of 0.0001 rad."""
    block = geodetic_block("zenith", ("point", "point"), (0.0, 0.0))
    block = replace(block, geodetic=replace(block.geodetic, sigma=np.array([1e-4])))
    xyz = np.array([[0.0, 0, 0], [1200.0, 1600.0, 50.0], [9.0, 9.0, 9.0]])
    (observed,) = zenith_angles(
        ObservationSource(block, None, np.zeros(3), {POINT: xyz}), ZenithOptions(refraction=0.13)
    )
    assert 'up to 28"' in observed.notes[0].text
    assert "1 of 1 by more than 0.1 sigma" in observed.notes[0].text


@pytest.mark.parametrize("axis", range(3))
def test_a_coordinate_difference_sees_its_coordinate_and_no_other(axis: int) -> None:
    (observed,) = _observed(("dX", "dY", "dZ")[axis], PLANE, ("point", "point"))
    assert [bool(seen) for seen in observed.sees] == [k == axis for k in range(3)]
