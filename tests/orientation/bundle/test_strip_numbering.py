"""Textbook numbering of strips: places, and the half bandwidth of regular blocks."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.structure.bandwidth import half_bandwidth
from aatri.adjustment.structure.graph import Graph, border_vertices
from aatri.orientation.bundle.strip_numbering import flown_lines, strip_numbering


def _flown(strips: int, images: int, azimuth_deg: float = 0.0, jitter: float = 0.0) -> tuple[np.ndarray, ...]:
    """Positions, strips and sequence of a block flown to and fro."""
    strip, place = np.repeat(np.arange(strips), images), np.tile(np.arange(images), strips)
    a = np.radians(azimuth_deg)
    xy = np.stack([100.0 * place, 180.0 * strip], axis=1)
    xy = xy + jitter * np.random.default_rng(4).normal(size=xy.shape)
    turned = xy @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    return turned, strip, np.where(strip % 2 == 0, place, -place).astype(float)


def _graph(strips: int, images: int) -> Graph:
    """60 % overlap along, 20 % across: an image meets the next two of its strip and of the neighbouring ones."""
    strip, place = np.repeat(np.arange(strips), images), np.tile(np.arange(images), strips)
    meets = (np.abs(strip[:, None] - strip) <= 1) & (np.abs(place[:, None] - place) <= 2)
    np.fill_diagonal(meets, False)
    return Graph(np.append(0, np.cumsum(meets.sum(axis=1))), np.nonzero(meets)[1].astype(np.int32))


def _band(graph: Graph, place: np.ndarray, first: int) -> tuple[int, int]:
    order = np.lexsort((place[:, 1 - first], place[:, first]))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return half_bandwidth(graph, rank, np.full(len(order), 6), np.zeros(len(order), dtype=bool))


@pytest.mark.parametrize(("strips", "images"), [(4, 30), (3, 20), (10, 25)])
@pytest.mark.parametrize("azimuth_deg", [0.0, 37.0, 90.0, 163.0])
def test_a_regular_block_has_the_band_of_the_textbook_whatever_its_direction(
    strips: int, images: int, azimuth_deg: float
) -> None:
    """m = (2N + 2) 6 across the strips, (n + 3) 6 along them: lecture notes, A1002."""
    numbering = strip_numbering(*_flown(strips, images, azimuth_deg, jitter=8.0))
    graph = _graph(strips, images)
    assert (numbering.strips, numbering.images) == (strips, images)
    assert _band(graph, numbering.place, 0) == (2 * strips + 2, 6 * (2 * strips + 2))
    assert _band(graph, numbering.place, 1) == (images + 3, 6 * (images + 3))
    assert numbering.textbook == {"across_strips": 2 * strips + 2, "along_strips": images + 3}


def test_cross_strips_do_not_count_as_parallel_ones() -> None:
    xy, strip, sequence = _flown(4, 12)
    cross = np.stack([np.full(5, 600.0), 150.0 * np.arange(5)], axis=1)
    numbering = strip_numbering(
        np.concatenate([xy, cross]), np.append(strip, np.full(5, 4)), np.append(sequence, np.arange(5.0))
    )
    assert (numbering.strips, numbering.images) == (4, 12)
    assert np.isfinite(numbering.place).all()


def test_a_block_without_strips_keeps_its_positions_and_has_no_textbook() -> None:
    xy, _, sequence = _flown(2, 3)
    numbering = strip_numbering(xy, np.full(6, -1), sequence)
    np.testing.assert_array_equal(numbering.place, xy)
    assert numbering.textbook == {}


def test_the_border_stands_beside_the_band() -> None:
    """A camera that all images meet is left out of the band, its unknowns of the rest are not."""
    n = 400
    chain = np.abs(np.arange(n)[:, None] - np.arange(n)) <= 2
    meets = np.ones((n + 1, n + 1), dtype=bool)
    meets[:n, :n] = chain
    np.fill_diagonal(meets, False)
    graph = Graph(np.append(0, np.cumsum(meets.sum(axis=1))), np.nonzero(meets)[1].astype(np.int32))
    size = np.append(np.full(n, 6), 3)
    assert half_bandwidth(graph, np.arange(n + 1), size, border_vertices(graph)) == (3, 18)


def test_a_line_of_flight_ends_at_a_turn_and_at_a_gap_and_cameras_have_their_own() -> None:
    along = np.column_stack([100.0 * np.arange(12), np.zeros((12, 2))])
    along[5:, 0] += 400.0  # a gap of five bases
    back = along[::-1] + np.array([0.0, 300.0, 0.0])
    head = np.concatenate([along, back])
    position_m = np.concatenate([head, head + np.array([0.0, 0.2, 0.0])])  # two heads that expose together
    position_m[2] = np.nan
    time_s = np.tile(np.arange(24.0), 2)
    shuffled = np.random.default_rng(1).permutation(48)
    lines = flown_lines(position_m[shuffled], time_s[shuffled], np.zeros(48), np.repeat([0, 1], 24)[shuffled])
    rows = sorted(shuffled[line].tolist() for line in lines)
    pieces = [np.r_[0:5], np.r_[5:12], np.r_[12:19], np.r_[19:24]]
    assert rows == [[0, 1, 3, 4], *(list(piece) for piece in pieces[1:]), *(list(24 + piece) for piece in pieces)]


def test_few_images_are_no_line() -> None:
    assert flown_lines(np.eye(3)[:2], np.arange(2.0), np.zeros(2), np.zeros(2, dtype=np.int64)) == []
    assert flown_lines(np.full((4, 3), np.nan), np.arange(4.0), np.zeros(4), np.zeros(4, dtype=np.int64)) == []
