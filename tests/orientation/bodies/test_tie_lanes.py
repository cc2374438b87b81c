"""Ties: the compiled lane equals the plain one, and derivatives equal differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.kernels.spectra import is_steady
from aatri.adjustment.records import whitened
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.strip_bases import strip_axes
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, STRIP_TIE
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.similarity_ties import Similarities, polynomial_ties, similarity_ties

RNG = np.random.default_rng(8)
N, POINTS, STRIPS = 40, 15, 3
STRIP_OF, POINT_OF = RNG.integers(0, STRIPS, N), RNG.integers(0, POINTS, N)
XYZ = RNG.uniform(-500, 500, (N, 3))
COVARIANCE = np.tile(np.diag([1e-4, 2e-4, 5e-4]), (N, 1, 1))
NAMES = ["1", "2", "3"]


def _similarities():
    ties = similarity_ties(STRIP_OF, POINT_OF, XYZ, COVARIANCE, names=NAMES)
    return ties, Similarities(RNG.normal(size=(3, 3)), RNG.uniform(0.5, 2, 3), exp_rotation(RNG.normal(size=(3, 3))))


def _polynomials():
    axes = [strip_axes(XYZ[k == STRIP_OF], RNG.uniform(-500, 500, (4, 3))) for k in range(3)]
    points = BodyPoints(STRIP_OF, POINT_OF, XYZ, COVARIANCE)
    ties = polynomial_ties(points, axes, names=NAMES, free=np.ones((3, 15), dtype=bool))
    return ties, RNG.normal(size=(3, 15))


@pytest.mark.parametrize("made", [_similarities, _polynomials])
def test_the_compiled_lane_equals_the_plain_one(made) -> None:
    ties, of_strips = made()
    records = replace(ties.records(STRIP_TIE), whitener=RNG.normal(size=(N, 3, 3)))
    state = {BODY: of_strips, POINT: RNG.normal(size=(POINTS, 3))}
    order = RNG.permutation(N)
    v, J = whitened(records, state, order[5:30])
    found = np.empty((25, 3)), np.empty((25, 3, ties.unknowns.size)), np.empty((25, 3, 3))
    assert records.compiled is not None
    records.compiled(order)(records.whitener[order])(state)(5, 30, found[0], found[1:])
    np.testing.assert_allclose(found[0], v, rtol=1e-12, atol=1e-10)
    for a, b in zip(found[1:], J):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("made", [_similarities, _polynomials])
def test_derivatives_equal_differences_of_the_ground_coordinates(made) -> None:
    ties, of_strips = made()
    J = ties.derivatives(of_strips, ties.rows)
    h = 1e-5
    for k in range(ties.unknowns.size):
        step = np.zeros((STRIPS, ties.unknowns.size))
        step[:, k] = h
        ahead = ties.on_ground(ties.unknowns.retract(of_strips, step), ties.rows)
        behind = ties.on_ground(ties.unknowns.retract(of_strips, -step), ties.rows)
        np.testing.assert_allclose((ahead - behind) / (2 * h), J[:, :, k], rtol=1e-7, atol=1e-5)


def test_covariances_turn_with_their_body_and_are_steady_below_a_thousandth() -> None:
    """s^2 R C R', and the norm of its change against `STEADY` of its own, with the deformation added."""
    ties, state = _similarities()
    values, vectors = ties.spectrum(state)
    s, R = state.scale[STRIP_OF], state.rotation[STRIP_OF]
    turned = s[:, None, None] ** 2 * (R @ COVARIANCE @ R.swapaxes(1, 2))
    np.testing.assert_allclose((vectors * values[:, None, :]) @ vectors.swapaxes(1, 2), turned, rtol=1e-12, atol=1e-16)
    a, limit = np.linalg.norm(turned, axis=(1, 2)).min(), 1e-3
    for change, steady in ((0.999 * limit * a, True), (1.001 * limit * np.linalg.norm(turned[7]), False)):
        C = turned.copy()
        C[7] += change / np.sqrt(3) * np.eye(3)
        assert is_steady(0, N, values, vectors, *map(np.ascontiguousarray, np.linalg.eigh(C)), 0.0, limit) is steady
    l, V = map(np.ascontiguousarray, np.linalg.eigh(C))  # noqa: E741
    assert is_steady(0, N, values, vectors, l, V, 100.0, limit), "beside a large deformation nothing changes"
