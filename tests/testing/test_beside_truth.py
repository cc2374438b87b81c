"""A fault in what a stage gives is found by the truth of the example, and its property and cure are named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.pipeline.methods.registry import find_stages
from aatri.tables.schema import Artifact
from aatri.testing.beside_truth import properties
from aatri.testing.example_inputs import example_block, example_inputs

ROLES = {
    "interior_orientation": "affine",
    "image_refinement": "systematic",
    "relative_orientation": "dependent",
    "strip_formation": "scale_transfer",
    "absolute_orientation": "similarity",
    "initial_orientation": "graph",
    "strip_adjustment": "polynomial",
    "model_adjustment": "independent_models",
    "bundle_adjustment": "intersection",
    "accuracy": "evaluation",
    "epochs": "congruence",
    "design": "criteria",
}
POINTS, SOLUTIONS = (
    ("interior_orientation", "image_refinement"),
    (
        "absolute_orientation",
        "initial_orientation",
        "strip_adjustment",
        "model_adjustment",
        "bundle_adjustment",
    ),
)


def transposed(values: Any) -> Any:
    return np.swapaxes(values, 1, 2)


def negated(values: Any) -> Any:
    return -values


def thousandfold(values: Any) -> Any:
    return 1e3 * values


def fivefold(values: Any) -> Any:
    return 5.0 * values


def one_turned(values: Any) -> Any:
    turned = values.copy()
    turned[1] = turned[1] @ np.diag([-1.0, -1.0, 1.0])
    return turned


def one_moved(values: Any) -> Any:
    moved = values.copy()
    moved[1] += 0.05 * np.nanmax(np.abs(values))
    return moved


Change = Callable[[Any], Any]
FAULTS: list[tuple[tuple[str, ...], str, Change, str]] = [
    (POINTS, "measurements.xy_mm", negated, "photo coordinates"),
    (POINTS, "measurements.xy_mm", thousandfold, "photo coordinates"),
    (POINTS, "measurements.xy_mm", one_moved, "photo coordinates"),
    (POINTS, "measurements.sigma_mm", thousandfold, "standard deviations"),
    (("relative_orientation",), "orientations.left_from_right", transposed, "orientations"),
    (("relative_orientation",), "orientations.left_from_right", one_turned, "orientations"),
    (("relative_orientation",), "orientations.left_from_right", negated, "rotations"),
    (("relative_orientation",), "orientations.base", negated, "orientations"),
    (("relative_orientation",), "orientations.covariance", negated, "covariances"),
    (("relative_orientation",), "model_points.xyz", negated, "points"),
    (("relative_orientation",), "model_points.xyz", thousandfold, "points"),
    (("relative_orientation",), "model_points.parallax_mm", thousandfold, "residuals"),
    (("relative_orientation",), "orientations.sigma0", fivefold, "standard deviations"),
    (("strip_formation",), "strip_images.strip_from_image", transposed, "orientations"),
    (("strip_formation",), "strip_images.position", negated, "orientations"),
    (("strip_formation",), "strip_points.xyz", negated, "points"),
    (("strip_formation",), "strip_points.xyz", thousandfold, "points"),
    (("strip_formation",), "strip_points.xyz", one_moved, "points"),
    (SOLUTIONS, "images.ground_from_image", transposed, "orientations"),
    (SOLUTIONS, "images.ground_from_image", one_turned, "orientations"),
    (SOLUTIONS, "images.position_m", negated, "orientations"),
    (SOLUTIONS, "images.position_m", one_moved, "orientations"),
    (SOLUTIONS, "points.xyz_m", negated, "points"),
    (SOLUTIONS, "points.xyz_m", thousandfold, "points"),
    (SOLUTIONS, "points.xyz_m", one_moved, "points"),
    (SOLUTIONS, "residuals.residual", negated, "residuals"),
    (SOLUTIONS, "residuals.residual", thousandfold, "residuals"),
    (("model_adjustment", "bundle_adjustment"), "points.covariance_m2", thousandfold, "standard deviations"),
    (("model_adjustment", "bundle_adjustment"), "points.covariance_m2", negated, "covariances"),
    (("accuracy",), "differences.difference_m", negated, "figures"),
    (("accuracy",), "figures.value", thousandfold, "figures"),
    (("epochs",), "displacements.xyz_m", negated, "points"),
    (("design",), "layout_points.xyz_m", thousandfold, "points"),
]
CASES = [(role, *fault) for roles, *fault in FAULTS for role in roles]
MADE: dict[str, tuple[dict[str, Artifact], Artifact]] = {}


def made_by(role: str) -> tuple[dict[str, Artifact], Artifact]:
    """Inputs and result of the role's variant on film; made once."""
    if role not in MADE:
        registry = find_stages()
        card = registry.card(f"{role}/{ROLES[role]}")
        given = example_inputs(role, registry.role(role))
        inputs = {port.name: given[port.name] for port in card.ports}
        extras = {"rng": np.random.default_rng(1)} if card.wants_rng else {}
        MADE[role] = inputs, card.function(**inputs, **extras)
    return MADE[role]


def breaches(inputs: dict[str, Artifact], made: Artifact) -> dict[str, str]:
    return {p.name: p.breach() for p in properties(example_block(), inputs, made) if p.breach()}


def test_every_role_that_takes_something_is_here() -> None:
    registry = find_stages()
    measuring = {"Block", "Information"}  # made of images, or of what is combined: other tests judge them
    judged = {role for role in registry.roles if registry.role(role).ports}
    assert set(ROLES) == {role for role in judged if registry.role(role).kind.kind not in measuring}
    assert set(ROLES) == {role for role, *_ in CASES}


@pytest.mark.parametrize("role", ROLES)
def test_a_good_result_has_no_breach(role: str) -> None:
    assert breaches(*made_by(role)) == {}


@pytest.mark.parametrize(("role", "where", "change", "name"), CASES)
def test_a_fault_is_found_and_named(role: str, where: str, change: Change, name: str) -> None:
    inputs, good = made_by(role)
    table, column = where.split(".")
    rows = getattr(good, table)
    bad = replace(good, **{table: replace(rows, **{column: change(getattr(rows, column))})})
    said = breaches(inputs, bad)
    assert name in said
    cure = {transposed: "transposed", negated: "sign changed", thousandfold: "divided by 1000"}.get(change, "")
    if name in ("orientations", "points", "photo coordinates"):
        assert cure in said[name]
