"""The methods of relative orientation beside each other, as stages."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.models import Models
from aatri.geometry.rotations import rotation_from_angles
from aatri.stages.relative_orientation.connected import ConnectedOptions, connected
from aatri.stages.relative_orientation.dependent import ClassicalOptions, dependent
from aatri.stages.relative_orientation.independent import independent
from tests.stages.film_blocks import Told
from tests.stages.made_strips import made_strips


def elements_of(models: Models, model: int) -> dict[str, tuple[float, float]]:
    e = models.elements
    assert e is not None
    rows = np.flatnonzero(e.model == model)
    return {str(n): (float(v), float(s)) for n, v, s in zip(e.name[rows], e.value[rows], e.sigma[rows])}


@pytest.fixture(scope="module")
def made() -> Any:
    return made_strips(4, 2)


@pytest.mark.parametrize("variant", [dependent, independent, connected])
def test_error_free_strips_give_the_true_models_by_every_method(made: Any, variant: Any) -> None:
    models = variant(made.block, made.image_points)
    o = models.orientations
    assert len(o) == 6
    for k, (i, j) in enumerate(zip(o.left, o.right)):
        base = made.R[i].T @ (made.X0[j] - made.X0[i])
        assert o.left_from_right[k] == pytest.approx(made.R[i].T @ made.R[j], abs=1e-9)
        assert o.base[k] == pytest.approx(base / np.linalg.norm(base), abs=1e-9)


@pytest.mark.parametrize("equation", ["q", "determinant"])
@pytest.mark.parametrize(("variant", "options"), [(dependent, ClassicalOptions), (independent, ClassicalOptions)])
def test_error_free_strips_give_the_true_models_by_every_equation(
    made: Any, variant: Any, options: Any, equation: str
) -> None:
    o = variant(made.block, made.image_points, options=options(equation=equation)).orientations
    for k, (i, j) in enumerate(zip(o.left, o.right)):
        assert o.left_from_right[k] == pytest.approx(made.R[i].T @ made.R[j], abs=1e-9)


def test_the_angles_of_the_independent_method_give_the_model_back(made: Any) -> None:
    models = independent(made.block, made.image_points)
    for model in range(len(models.orientations)):
        e = elements_of(models, model)
        assert list(e) == ["phi1", "kappa1", "phi2", "omega2", "kappa2"]
        R1 = rotation_from_angles([e["phi1"][0], 0.0, e["kappa1"][0]], "phi-omega-kappa")
        R2 = rotation_from_angles([e[n][0] for n in ("phi2", "omega2", "kappa2")], "phi-omega-kappa")
        assert pytest.approx(models.orientations.left_from_right[model], abs=1e-12) == R1.T @ R2
        assert R1[0] == pytest.approx(models.orientations.base[model], abs=1e-12)
        assert all(0 < sigma < 1e-2 for _, sigma in e.values())


def test_connected_models_carry_the_true_scales(made: Any) -> None:
    models = connected(made.block, made.image_points)
    o = models.orientations
    length = np.linalg.norm(made.X0[o.right] - made.X0[o.left], axis=1)
    for model in range(len(o)):
        e = elements_of(models, model)
        if model in (0, 3):  # the first of each strip
            assert "scale" not in e
        else:
            assert e["scale"][0] == pytest.approx(length[model] / length[model - 1], rel=1e-8)
            assert e["scale"][1] > 0


def test_connection_points_by_the_notes_rule_keep_the_height_of_the_model_before(made: Any) -> None:
    """A403: heights of the model before, counted from the common centre, in units of the model; the others by means."""
    m = made.image_points.measurements
    xy = m.xy_mm + np.random.default_rng(3).normal(0.0, 0.005, m.xy_mm.shape)
    points = replace(made.image_points, measurements=replace(m, xy_mm=xy))
    models = connected(made.block, points, options=ConnectedOptions(coordinates="coefficients"))
    rigorous = connected(made.block, points)
    o, p = models.orientations, models.model_points
    assert p.xyz == pytest.approx(rigorous.model_points.xyz, abs=2e-2)
    checked = 0
    for b in range(1, len(o)):
        a = b - 1
        if o.right[a] != o.left[b]:
            continue
        scale = elements_of(models, b)["scale"][0]
        wrong = set(models.suspects.point[models.suspects.image == o.id[b]].tolist())
        of_a, of_b = (np.flatnonzero((p.model == k) & p.active) for k in (a, b))
        _, i, j = np.intersect1d(p.point[of_a], p.point[of_b], return_indices=True)
        good = [str(made.block.points.id[q]) not in wrong for q in p.point[of_b[j]]]
        seen = (p.xyz[of_a[i]] - o.base[a]) @ o.left_from_right[a]
        assert (seen[:, 2] / scale)[good] == pytest.approx(p.xyz[of_b[j], 2][good], abs=1e-12)
        assert (rigorous.model_points.xyz[of_b[j], 2] != p.xyz[of_b[j], 2]).any()
        checked += sum(good)
    assert checked > 10


def test_without_common_points_of_two_models_the_connection_is_told_as_missing(made: Any) -> None:
    """Points of image 1-01 are measured in one of its neighbours only."""
    m = made.image_points.measurements
    first, third = np.flatnonzero(made.block.images.id == "1-00")[0], np.flatnonzero(made.block.images.id == "1-02")[0]
    of_third = set(m.point[m.image == third].tolist())
    shared = (m.image == first) & np.isin(m.point, sorted(of_third))
    keep = np.flatnonzero(shared)
    assert len(keep) > 2
    points = replace(
        made.image_points, measurements=replace(m, active=m.active & ~np.isin(np.arange(len(m)), keep[1:]))
    )

    log = Told()
    models = connected(made.block, points, context=log)
    if len(models.orientations) == 6:
        assert any("without connection" in text and "1-01-1-02" in text for text in log.warnings)
        assert "scale" not in elements_of(models, 1)
