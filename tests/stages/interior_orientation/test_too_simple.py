"""An interior orientation with too few parameters is told, and no mark is blamed alone."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.errors import GeometryError
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.similarity import similarity
from tests.stages.film_blocks import Told, flown, with_marks


@pytest.fixture(scope="module")
def block() -> Block:
    return flown()


def sheared(block: Block, by: float) -> Block:
    for image in range(len(block.images)):
        block = with_marks(block, image, lambda xy: xy @ np.array([[1.0, 0.0], [by, 1.0]]))
    return block


def test_a_similarity_on_film_that_shears_is_called_too_simple(block: Block) -> None:
    told, fits = Told(), Told()
    similarity(sheared(block, 2e-4), context=told)
    assert any("too simple for this film" in t and "interior_orientation/affine" in t for t in told.warnings)
    affine(sheared(block, 2e-4), context=fits)
    assert not any("too simple" in t for t in fits.warnings)
    with pytest.raises(GeometryError) as caught:
        similarity(sheared(block, 1e-3))
    assert "too simple for this film" in str(caught.value)
