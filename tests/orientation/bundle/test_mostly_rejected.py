"""Images of which a search has rejected most image points: one may be wrong as a whole, and bends the rest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.orientation.bundle.groups.failed_search import mostly_rejected_images
from aatri.orientation.bundle.groups.limits import MOST_RAYS_TRIED


@pytest.mark.parametrize(("sigma0", "redundancy", "images"), [(1.0, 500, []), (1.3, 4, []), (1.5, 500, [2])])
def test_they_are_named_where_the_rest_does_not_fit(sigma0: float, redundancy: int, images: list[int]) -> None:
    """Four images of ten points: of the third seven are rejected, of the fourth five, and one was never in use."""
    image = np.repeat(np.arange(4), 10)
    active = np.ones(40, dtype=bool)
    active[0] = False
    used = active.copy()
    used[20:27] = used[30:35] = False
    rays: Any = SimpleNamespace(image=image, active=active)
    adjusted = SimpleNamespace(sigma0=sigma0, redundancy=redundancy)
    result: Any = SimpleNamespace(adjusted=adjusted, ray_used=used, image_adjusted=np.ones(4, dtype=bool))
    assert mostly_rejected_images(rays, result) == images


def test_images_without_a_start_and_those_of_large_blocks_are_not_asked_and_the_worst_comes_first() -> None:
    image = np.repeat(np.arange(4), 10)
    used = np.ones(40, dtype=bool)
    used[:10] = used[10:16] = used[20:28] = False  # none, four, two of ten, all
    adjusted = SimpleNamespace(sigma0=1.5, redundancy=500)
    oriented = np.array([False, True, True, True])
    result: Any = SimpleNamespace(adjusted=adjusted, ray_used=used, image_adjusted=oriented)
    rays: Any = SimpleNamespace(image=image, active=np.ones(40, dtype=bool))
    assert mostly_rejected_images(rays, result) == [2, 1]
    many = np.tile(image, MOST_RAYS_TRIED // 40 + 1)
    large: Any = SimpleNamespace(image=many, active=np.ones(len(many), dtype=bool))
    assert mostly_rejected_images(large, result) == []
