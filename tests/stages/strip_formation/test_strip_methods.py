"""The methods of strip formation beside each other, as stages."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.stages.relative_orientation.connected import connected as connected_models
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.connected import connected
from aatri.stages.strip_formation.scale_transfer import ScaleTransferOptions, scale_transfer
from aatri.stages.strip_formation.similarity import similarity
from tests.stages.film_blocks import Told
from tests.stages.made_strips import made_strips


@pytest.fixture(scope="module")
def made() -> Any:
    return made_strips(5, 2)


def right_shape(made: Any, strips: Any, places: float = 1e-8) -> None:
    """Projection centres of every strip are those of the truth, turned and scaled by the first base."""
    table = strips.strip_images
    for strip in range(len(strips.strips)):
        rows = np.flatnonzero(table.strip == strip)
        images = table.image[rows]
        R, X0 = made.R[images[0]], made.X0[images]
        true = (X0 - X0[0]) @ R / np.linalg.norm(X0[1] - X0[0])
        assert table.position[rows] == pytest.approx(true, abs=places)
        points = np.flatnonzero(strips.strip_points.strip == strip)
        X = made.ground[strips.strip_points.point[points]]
        true = (X - X0[0]) @ R / np.linalg.norm(X0[1] - X0[0])
        assert strips.strip_points.xyz[points] == pytest.approx(true, abs=10 * places)


@pytest.mark.parametrize("estimator", ["robust", "weighted", "mean"])
def test_error_free_models_give_the_true_strips_by_every_mean(made: Any, estimator: Any) -> None:
    strips = scale_transfer(
        made.block, dependent(made.block, made.image_points), options=ScaleTransferOptions(estimator=estimator)
    )
    right_shape(made, strips)


def test_error_free_models_give_the_true_strips_by_similarities(made: Any) -> None:
    right_shape(made, similarity(made.block, dependent(made.block, made.image_points)), 1e-7)


def test_error_free_connected_models_give_the_true_strips(made: Any) -> None:
    models = connected_models(made.block, made.image_points)
    right_shape(made, connected(made.block, models))
    right_shape(made, scale_transfer(made.block, models))


def test_models_without_scale_are_refused_by_connected(made: Any) -> None:
    with pytest.raises(GeometryError, match="carry no scale") as caught:
        connected(made.block, dependent(made.block, made.image_points))
    assert "relative_orientation/connected" in str(caught.value.remedy)


def test_a_strip_is_split_where_a_model_carries_no_scale(made: Any) -> None:
    models = connected_models(made.block, made.image_points)
    e = models.elements
    keep = np.flatnonzero(~((e.name == "scale") & (e.model == 2)))
    strips = connected(made.block, replace(models, elements=e.take(keep)))
    assert len(strips.strips) == 3
    assert any("carry no scale" in reason for reason in strips.gaps.reason)


def test_strips_are_found_where_none_are_given(made: Any) -> None:
    images = replace(
        made.block.images, strip=np.full(len(made.block.images), -1), sequence=np.zeros(len(made.block.images))
    )
    block, told = replace(made.block, images=images), Told()
    models = dependent(block, made.image_points, context=told)
    assert any("strips found from the overlaps" in text for text in told.warnings)
    strips = scale_transfer(block, models)
    assert strips.strips.id.tolist() == ["found 1", "found 2"]
    right_shape(made, strips)


def test_a_sequence_that_runs_back_is_told(made: Any) -> None:
    """Images 2 and 3 of a strip exchanged: with 60 % overlap the pairs 1-3 and 2-4 hardly hold together."""
    sequence = made.block.images.sequence.copy()
    rows = np.flatnonzero(made.block.images.strip == 0)[[1, 2]]
    sequence[rows] = sequence[rows[::-1]]
    block, told = replace(made.block, images=replace(made.block.images, sequence=sequence)), Told()
    models = dependent(block, made.image_points, context=told)
    scale_transfer(block, models, context=told)
    said = " ".join(told.warnings)
    assert "sequence" in said or "no model" in said
