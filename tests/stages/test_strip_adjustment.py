"""strip_adjustment/polynomial on made-up free strips."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.rotations import log_rotation
from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from aatri.stages.strip_adjustment.polynomial import PolynomialOptions, polynomial
from tests.made_strips import Heard, MadeBlock


def _adjusted(made, *, components="all", **options):
    heard = Heard()
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial = similarity(block, strips, points, options=SimilarityOptions(components=components))
    solution = polynomial(block, points, strips, initial, options=PolynomialOptions(**options), context=heard)
    return initial, solution, heard


def _rms(made, solution):
    return np.sqrt(np.nanmean((solution.points.xyz_m - made.truth) ** 2))


def _bend(strip, X):
    """A sag along the strip and a tilt growing along it."""
    u = X[0] / 1000.0
    return np.array([0.0, 0.0, (1.5 if strip % 2 else -1.5) * u * u + 0.001 * u * X[1]])


def test_error_free_strips_stay_exact_and_so_do_the_resected_images():
    made = MadeBlock(3, 5)
    made.control(range(0, len(made.truth), 7))
    _, solution, _ = _adjusted(made)
    turn = log_rotation(solution.images.ground_from_image @ made.truth_R.swapaxes(1, 2))
    assert np.nanmax(np.abs(solution.points.xyz_m - made.truth)) < 1e-6
    assert np.abs(solution.images.position_m - made.truth_X0).max() < 1e-6
    assert np.abs(turn).max() < 1e-9


def test_bent_strips_are_straightened():
    made = MadeBlock(3, 6, deformation=_bend)
    made.control(range(0, len(made.truth), 5))
    initial, solution, heard = _adjusted(made)
    assert heard.warnings == []
    assert _rms(made, initial) > 0.05
    assert _rms(made, solution) < 0.015
    models = set(solution.transformations.model.tolist())
    assert models == {"similarity", "polynomial_2"}


def test_the_degree_falls_with_little_control_and_the_fall_is_reported():
    made = MadeBlock(2, 6)
    made.control(made.corners())
    _, solution, heard = _adjusted(made)
    assert "polynomial_2" not in solution.transformations.model
    assert any(text.startswith("strip 1, height: polynomial_") and "rank 9 of 10" in text for text in heard.warnings)
    assert _rms(made, solution) < 1e-6


def test_a_degree_can_be_asked_for():
    made = MadeBlock(2, 6)
    made.control(range(0, len(made.truth), 5))
    _, solution, _ = _adjusted(made, degree=1)
    assert set(solution.transformations.model.tolist()) == {"similarity", "polynomial_1"}


def test_strips_that_are_not_oriented_are_left_out_and_named():
    made = MadeBlock(2, 5, gap_m=400.0)
    made.control(np.flatnonzero(made.truth[:, 1] < made.truth[:, 1].mean())[::5])
    _, solution, heard = _adjusted(made, components="largest")
    assert solution.images.oriented.sum() == 5
    assert any("left out: 2" in text for text in heard.warnings)


def test_control_rejected_before_is_tested_again():
    made = MadeBlock(3, 6, noise_m=0.01)
    made.control(range(0, len(made.truth), 6), sigma_m=0.01)
    made.control([24], sigma_m=0.01, error_m=(0.0, 0.0, 1.5))
    initial, solution, _ = _adjusted(made)
    assert initial.suspects.point.tolist() == ["p024"]
    assert solution.suspects.point[solution.suspects.kind == "control"].tolist() == ["p024"]
    assert set(solution.suspects.stage.tolist()) == {"strip_adjustment"}


def test_an_initial_solution_without_orientations_is_refused():
    made = MadeBlock(2, 5)
    made.control(made.corners())
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial = similarity(block, strips, points)
    from dataclasses import replace

    nothing = replace(
        initial.images,
        oriented=np.zeros(10, dtype=bool),
        position_m=np.full((10, 3), np.nan),
        ground_from_image=np.full((10, 3, 3), np.nan),
    )
    with pytest.raises(GeometryError, match="orients no strip"):
        polynomial(block, points, strips, replace(initial, images=nothing))
