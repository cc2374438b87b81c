"""Neighbouring images of a block, the points they share, and the Models made of their relative orientations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, triu

from aatri.adapters.pairs.film_in_orientations import film_in_orientations
from aatri.adapters.solution import stacked
from aatri.adapters.uncontrolled_before import in_no_model, seen_by_one
from aatri.adjustment.statistics.uncontrolled import BELOW
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import ModelPoints, Models, Orientations, Unformed
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.vectors import finite_rows
from aatri.orientation.relative.common_points import common_points
from aatri.orientation.relative.orientations import RelativeOrientations


@dataclass(frozen=True)
class Pairs:
    """Pairs of images and their common points, pair by pair and by point.

    Attributes
    ----------
    left, right : (m,) int32
        Rows in images.
    start : (m + 1,) int64
        First common point of each pair; the last is their number.
    point : (n,) int32
        Rows in points, ascending within a pair.
    left_row, right_row : (n,) int32
        Rows of the measurements.
    rays : RayPairs
    """

    left: Int
    right: Int
    start: Int
    point: Int
    left_row: Int
    right_row: Int
    rays: RayPairs

    def names(self, block: Block) -> Text:
        """Ids of the models, left-right."""
        ids = block.images.id
        return np.char.add(np.char.add(ids[self.left], "-"), ids[self.right])


def images_of_strip(block: Block, strip: int) -> Int:
    """Active images of a strip in order: by sequence, then by id; those without a sequence come last."""
    rows = np.flatnonzero(block.images.active & (block.images.strip == strip))
    return rows[np.lexsort((rows, block.images.sequence[rows]))]


def neighbouring_images(block: Block) -> Int:
    """Consecutive images of all strips, (m, 2) rows in images."""
    strips = [images_of_strip(block, strip) for strip in range(len(block.strips))]
    pairs = [np.column_stack([rows[:-1], rows[1:]]) for rows in strips]
    return np.concatenate([np.zeros((0, 2), dtype=np.intp), *pairs])


def overlapping_images(block: Block, image_points: ImagePoints, least: int) -> tuple[Int, Int]:
    """Pairs of active images with at least `least` points in common, wherever they were taken.

    Returns
    -------
    images : (m, 2) int
        Rows in images, the smaller first.
    common : (m,) int
        Points in common.
    """
    m = image_points.measurements
    use = m.active & np.isfinite(m.xy_mm).all(axis=1) & block.images.active[m.image]
    seen = csr_array((np.ones(int(use.sum()), dtype=np.int32), (m.image[use], m.point[use])),
                     shape=(len(block.images), len(block.points)))  # fmt: skip
    seen.sum_duplicates()
    seen.data[:] = 1  # of a point measured twice the first counts
    shared = triu((seen @ seen.T).tocoo(), k=1)
    enough = shared.data >= least
    pairs, common = np.column_stack([shared.row[enough], shared.col[enough]]), shared.data[enough]
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return pairs[order].astype(np.intp), common[order].astype(np.int64)


def doubtful_sequences(block: Block, image_points: ImagePoints, margin: float = 1.5) -> list[tuple[int, int]]:
    """Images whose place in their strip is doubtful: they share more points with an image that is not beside them.

    Parameters
    ----------
    block : Block
    image_points : ImagePoints
    margin : float
        How many times more points than with either neighbour.

    Returns
    -------
    list of (image, image it shares most points with)
    """
    m = image_points.measurements
    seen = csr_array(
        (m.active.astype(np.int32), (m.image, m.point)), shape=(len(block.images), len(block.points)), dtype=np.int32
    )
    found = []
    for strip in range(len(block.strips)):
        rows = images_of_strip(block, strip)
        part = seen[rows]
        shared = (part @ part.T).toarray()
        place = np.arange(len(rows))
        beside = np.abs(place[:, None] - place) == 1
        most_beside = np.where(beside, shared, 0).max(axis=1, initial=0)
        others = np.where(beside | np.eye(len(rows), dtype=bool), 0, shared)
        doubtful = others.max(axis=1, initial=0) > margin * most_beside
        found += [(int(rows[k]), int(rows[others[k].argmax()])) for k in np.flatnonzero(doubtful)]
    return found


def pairs_of(block: Block, image_points: ImagePoints, images: Int) -> Pairs:
    """The common points of pairs of images, from active measurements.

    Parameters
    ----------
    block : Block
    image_points : ImagePoints
    images : (m, 2) int
        Rows in images.
    """
    m = image_points.measurements
    usable = np.flatnonzero(m.active & np.isfinite(m.xy_mm).all(axis=1))
    key = m.image[usable].astype(np.int64) * len(block.points) + m.point[usable]
    order = np.argsort(key, kind="stable")
    rows, key = usable[order], key[order]
    single = np.concatenate([[True], key[1:] != key[:-1]])[: len(key)]  # of a point measured twice the first counts
    rows, key = rows[single], key[single]
    first = np.searchsorted(key, np.arange(len(block.images) + 1, dtype=np.int64) * len(block.points))
    left, right = (images[:, side].astype(np.int32) for side in (0, 1))
    start, a, b = common_points(images, first, m.point[rows])
    pair, a, b = np.repeat(np.arange(len(left)), np.diff(start)), rows[a], rows[b]
    c_mm = block.cameras.principal_distance_mm[block.images.camera]
    return Pairs(
        left, right, start, m.point[a].astype(np.int32), a.astype(np.int32), b.astype(np.int32),
        RayPairs(np.column_stack([m.xy_mm[a], -c_mm[left[pair]]]), np.column_stack([m.xy_mm[b], -c_mm[right[pair]]]),
             m.sigma_mm[a], m.sigma_mm[b]),
    )  # fmt: skip


def models_of(block: Block, image_points: ImagePoints, pairs: Pairs, found: RelativeOrientations) -> Models:
    """Models of oriented pairs, and the pairs that make none with the reason."""
    formed, unformed = np.flatnonzero(found.formed), np.flatnonzero(~found.formed)
    model_of = np.full(len(pairs.left), -1, dtype=np.int32)
    model_of[formed] = np.arange(len(formed))
    model = np.repeat(model_of, np.diff(pairs.start))
    film = film_in_orientations(block, image_points, pairs.rays, pairs.start, (pairs.left, pairs.left_row),
                                (pairs.right, pairs.right_row), found)  # fmt: skip
    points, parallax = _model_points(pairs, model, found)
    made = Models(
        images=image_points.images,
        points=image_points.points,
        orientations=Orientations(
            id=np.asarray(pairs.names(block)[formed], dtype=np.str_),
            left=pairs.left[formed],
            right=pairs.right[formed],
            left_from_right=found.left_from_right[formed],
            base=found.base[formed],
            covariance=(found.covariance + film)[formed],
            sigma0=found.sigma0[formed],
            redundancy=found.redundancy[formed].astype(np.int32),
            iterations=found.iterations[formed].astype(np.int32),
        ),
        model_points=points,
        unformed=Unformed(
            left=pairs.left[unformed],
            right=pairs.right[unformed],
            common_points=np.diff(pairs.start)[unformed].astype(np.int32),
            reason=np.array([found.reasons[pair] for pair in unformed.tolist()], dtype=np.str_),
        ),
        suspects=stacked([image_points.suspects, _suspects(block, pairs, model, found)]),
    )
    mine, m = model >= 0, image_points.measurements
    in_models = np.concatenate([pairs.left_row[mine], pairs.right_row[mine]])
    alone = in_no_model(block, m.active & finite_rows(m.xy_mm) & block.images.active[m.image], in_models)
    return replace(made, uncontrolled=stacked([alone, _uncontrolled(block, made, parallax)]))


def _uncontrolled(block: Block, models: Models, redundancy: Float) -> Uncontrolled:
    """Along the base the points of one model only; across it those whose y-parallax is not controlled."""
    p = models.model_points
    single = np.bincount(p.point[p.active], minlength=len(block.points))[p.point] == 1
    weak = redundancy < BELOW
    across = seen_by_one(block, models, np.flatnonzero(p.active & weak), redundancy[p.active & weak])
    return stacked([across, seen_by_one(block, models, np.flatnonzero(p.active & single))])


def _model_points(pairs: Pairs, model: Int, found: RelativeOrientations) -> tuple[ModelPoints, Float]:
    """Points that have an intersection, and the redundancy numbers of their y-parallaxes; the others are suspects."""
    rows = np.flatnonzero((model >= 0) & finite_rows(found.point_covariance))
    error = np.abs(found.error_mm[rows])
    # The estimated error of a parallax is the parallax over its redundancy number.
    with np.errstate(divide="ignore", invalid="ignore"):
        redundancy = np.where(error > 0, np.abs(found.parallax_mm[rows]) / error, 1.0)
    redundancy = np.where(np.isnan(found.test[rows]), 0.0, redundancy)
    points = ModelPoints(
        model=model[rows],
        point=pairs.point[rows],
        xyz=found.xyz[rows],
        covariance=found.point_covariance[rows],
        parallax_mm=found.parallax_mm[rows],
        active=found.active[rows],
    )
    return points, redundancy


def _suspects(block: Block, pairs: Pairs, model: Int, found: RelativeOrientations) -> Suspects:
    """Rejected points; the row is that of the right image's measurement, though the error may be in the left one."""
    rows = np.flatnonzero((model >= 0) & ~found.active)
    n = len(rows)
    return Suspects(
        kind=np.full(n, "image_point"),
        row=pairs.right_row[rows],
        image=block.images.id[np.repeat(pairs.right, np.diff(pairs.start))[rows]],
        point=block.points.id[pairs.point[rows]],
        stage=np.full(n, "relative_orientation"),
        size=found.error_mm[rows],
        unit=np.full(n, "mm"),
        sigma=found.error_sigma_mm[rows],
        test=found.test[rows],
        verdict=np.full(n, "rejected"),
    )
