"""Strips are found from the overlaps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.orientation.strips.overlap_order import strips_by_overlap


def flown(strips: int, images: int, forward: float, side: float, seed: int = 1) -> Any:
    """Vertical images of a plane, strips to and fro, image rows in a random order."""
    rng = np.random.default_rng(seed)
    half, c = 0.7, 150.0
    base, across = 2 * half * (1 - forward), 2 * half * (1 - side)
    ground = rng.uniform([-1, -1], [images * base + 1, strips * across + 1], (3000, 2))
    name, centre, heading = [], [], []
    for s in range(strips):
        for k in range(images):
            at = k if s % 2 == 0 else images - 1 - k
            name.append((s, k))
            centre.append([at * base + rng.normal(0, 0.02), s * across + rng.normal(0, 0.02)])
            heading.append(np.pi * (s % 2) + rng.normal(0, 0.02))
    order = rng.permutation(len(name))
    rows = []
    for row, k in enumerate(order):
        turn = np.array([[np.cos(heading[k]), np.sin(heading[k])], [-np.sin(heading[k]), np.cos(heading[k])]])
        u = (ground - centre[k]) @ turn.T
        seen = np.flatnonzero((np.abs(u) < half).all(axis=1))
        rows.append((np.full(len(seen), row), seen, c * u[seen]))
    image, point, xy = (np.concatenate(column) for column in zip(*rows))
    return image, point, xy, [name[k] for k in order]


@pytest.mark.parametrize(("forward", "side"), [(0.6, 0.3), (0.8, 0.6), (0.75, 0.6)])
def test_strips_to_and_fro_are_found_in_their_order(forward: float, side: float) -> None:
    image, point, xy, names = flown(4, 7, forward, side)
    chains = [[names[k] for k in chain] for chain in strips_by_overlap(image, point, xy, len(names))]
    assert len(chains) == 4
    for chain in chains:
        assert {s for s, _ in chain} == {chain[0][0]}
        order = [k for _, k in chain]
        assert order in (list(range(7)), list(range(6, -1, -1)))


def test_an_image_without_points_is_in_no_strip() -> None:
    image, point, xy, names = flown(1, 5, 0.6, 0.3)
    keep = image != 2
    assert 2 not in np.concatenate(strips_by_overlap(image[keep], point[keep], xy[keep], len(names)))
    assert strips_by_overlap(image[:0], point[:0], xy[:0], 3) == []
