"""Parts that hang on one image: as taking every image away in turn finds them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from aatri.checks.after.hinge_image import hanging_parts
from aatri.checks.limits import OWN_DATUM


def _by_removal(adjacent: np.ndarray, own: np.ndarray) -> set[int]:
    """Images without which their neighbourhood falls apart, one part of two images or more without a datum."""
    hinges = set()
    _, whole = connected_components(csr_array(adjacent), directed=False)
    for k in range(len(adjacent)):
        rest = adjacent.copy()
        rest[k] = rest[:, k] = 0
        _, part = connected_components(csr_array(rest), directed=False)
        parts = [np.flatnonzero((part == p) & (np.arange(len(own)) != k) & (whole == whole[k])) for p in set(part)]
        parts = [p for p in parts if len(p)]
        for p in parts if len(parts) > 1 else ():
            others = np.concatenate([q for q in parts if q is not p])
            loose = own[p].sum() < OWN_DATUM and len(p) > 1
            if loose and (len(p) <= len(others) or own[others].sum() >= OWN_DATUM):
                hinges.add(k)
    return hinges


@pytest.mark.parametrize("seed", range(40))
def test_hinges_are_those_that_removal_finds(seed: int) -> None:
    chance = np.random.default_rng(seed)
    n = int(chance.integers(4, 14))
    upper = np.triu(chance.random((n, n)) < 1.6 / n, 1)
    adjacent = (upper | upper.T).astype(float)
    own = np.array([float(chance.integers(0, 3)) for _ in range(n)])
    own[:] = 0.0 if seed % 2 else own
    found = {hinge for hinge, _ in hanging_parts([np.flatnonzero(row) for row in adjacent], own)}
    assert found <= _by_removal(adjacent, own)
    if seed % 2:  # nothing has a datum: smaller parts hang, and both ways agree
        assert found == _by_removal(adjacent, own)


def test_the_half_without_control_hangs() -> None:
    chain = [np.array([k for k in (j - 1, j + 1) if 0 <= k < 5]) for j in range(5)]
    own = np.array([3.0, 0.0, 0.0, 0.0, 0.0])
    found = {hinge: sorted(part.tolist()) for hinge, part in hanging_parts(chain, own)}
    assert found == {1: [2, 3, 4], 2: [3, 4]}
    assert list(hanging_parts(chain, np.array([3.0, 0, 0, 0, 3.0]))) == []
