"""Whether a named cause contradicts a result is judged by what it does to that result, not to one on the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.small_blocks import adjusted_by, flown


@pytest.mark.slow
@pytest.mark.parametrize(("k1", "positions", "contradictions"), [(3e-6, True, 0), (1e-6, False, 1)])
def test_a_lens_beyond_its_weights_contradicts_the_result_where_that_is_off(
    tmp_path: Path, k1: float, positions: bool, contradictions: int
) -> None:
    """Parameters of 50 um (`sigma_um`) take up 3.5 mm at the corners; positions hold c, without them Z is off."""
    small = flown(3, 6, points=25)
    for key, ideal in small.rays.items():
        for _ in range(20):
            small.rays[key] = ideal - small.rays[key] * k1 * (small.rays[key] ** 2).sum()
    often = {p: sum(q == p for _, q in small.rays) for p in small.xyz_m}
    inner = sorted(p for p in small.xyz_m if often[p] > 2)
    chosen = np.random.default_rng(1).choice(inner, 8, replace=False).tolist()
    small.control = dict.fromkeys([*[p for p in small.control if often[p] > 1], *chosen], "XYZ")
    small.observed = small.observed if positions else {}
    folder = small.write(tmp_path / "b")
    done = adjusted_by("graph", folder, self_calibration={"set": "aicon"}).bundle
    p = done.points
    off = p.xyz_m - np.array([small.xyz_m[point] for point in p.id])
    size = np.abs(off) / np.sqrt(np.einsum("nii->ni", p.covariance_m2))
    assert (np.nanmax(size) > 4.2) == bool(contradictions)
    assert done.contradictions == contradictions
