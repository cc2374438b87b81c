"""Neighbouring images of a block, the points they share, and the Models made of their relative orientations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from aatri.adapters.solution import stacked
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import ModelPoints, Models, Orientations, Unformed
from aatri.artifacts.suspects import Suspects
from aatri.geometry.coplanarity import Rays, ray_directions
from aatri.geometry.vectors import finite_rows
from aatri.orientation.relative.dependent import RelativeOrientation

Rows = Int


@dataclass(frozen=True)
class Pair:
    """Two images and their common points.

    Attributes
    ----------
    left, right : int
        Rows in images.
    point : (n,) int
        Rows in points, ascending.
    left_row, right_row : (n,) int
        Rows of the measurements.
    rays : Rays
    """

    left: int
    right: int
    point: Rows
    left_row: Rows
    right_row: Rows
    rays: Rays


def images_of_strip(block: Block, strip: int) -> Int:
    """Active images of a strip in order: by sequence, then by id; those without a sequence come last."""
    rows = np.flatnonzero(block.images.active & (block.images.strip == strip))
    return rows[np.lexsort((rows, block.images.sequence[rows]))]


def neighbouring_images(block: Block) -> Int:
    """Consecutive images of all strips, (m, 2) rows in images."""
    strips = [images_of_strip(block, strip) for strip in range(len(block.strips))]
    pairs = [np.column_stack([rows[:-1], rows[1:]]) for rows in strips]
    return np.concatenate([np.zeros((0, 2), dtype=np.intp), *pairs])


def doubtful_places(block: Block, image_points: ImagePoints, margin: float = 1.5) -> list[tuple[int, int]]:
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


def pairs_of(block: Block, image_points: ImagePoints, images: Int) -> list[Pair]:
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
    rows = usable[np.lexsort((usable, m.point[usable], m.image[usable]))]
    first = np.searchsorted(m.image[rows], np.arange(len(block.images) + 1))
    c_mm = block.cameras.principal_distance_mm[block.images.camera]
    pairs = []
    for left, right in images:
        of_left, of_right = rows[first[left] : first[left + 1]], rows[first[right] : first[right + 1]]
        point, k, j = np.intersect1d(m.point[of_left], m.point[of_right], return_indices=True)
        a, b = of_left[k], of_right[j]
        rays = Rays(ray_directions(m.xy_mm[a], c_mm[left]), ray_directions(m.xy_mm[b], c_mm[right]),
                    m.sigma_mm[a], m.sigma_mm[b])  # fmt: skip
        pairs.append(Pair(int(left), int(right), point, a.astype(np.int32), b.astype(np.int32), rays))
    return pairs


def pair_id(block: Block, pair: Pair) -> str:
    """Id of the model of a pair: left-right."""
    return f"{block.images.id[pair.left]}-{block.images.id[pair.right]}"


def models_of(
    block: Block,
    image_points: ImagePoints,
    formed: Sequence[tuple[Pair, RelativeOrientation]],
    unformed: Sequence[tuple[Pair, str]],
) -> Models:
    """Models of oriented pairs, and the pairs that make none with the reason."""
    suspects = [_suspects(block, pair, found) for pair, found in formed]
    return Models(
        images=image_points.images,
        points=image_points.points,
        orientations=_orientations(block, formed),
        model_points=stacked(
            [ModelPoints.empty(), *(_model_points(k, pair, found) for k, (pair, found) in enumerate(formed))]
        ),
        unformed=Unformed(
            left=np.array([pair.left for pair, _ in unformed], dtype=np.int32),
            right=np.array([pair.right for pair, _ in unformed], dtype=np.int32),
            common_points=np.array([len(pair.point) for pair, _ in unformed], dtype=np.int32),
            reason=np.array([reason for _, reason in unformed], dtype=np.str_),
        ),
        suspects=stacked([image_points.suspects, *suspects]),
    )


def _orientations(block: Block, formed: Sequence[tuple[Pair, RelativeOrientation]]) -> Orientations:
    if not formed:
        return Orientations.empty()
    pairs, found = zip(*formed)
    return Orientations(
        id=np.array([pair_id(block, pair) for pair in pairs]),
        left=np.array([pair.left for pair in pairs], dtype=np.int32),
        right=np.array([pair.right for pair in pairs], dtype=np.int32),
        left_from_right=np.array([f.left_from_right for f in found]),
        base=np.array([f.base for f in found]),
        covariance=np.array([f.covariance for f in found]),
        sigma0=np.array([f.sigma0 for f in found]),
        redundancy=np.array([f.redundancy for f in found], dtype=np.int32),
        iterations=np.array([f.iterations for f in found], dtype=np.int32),
    )


def _model_points(model: int, pair: Pair, found: RelativeOrientation) -> ModelPoints:
    """Points that have an intersection; the others are among the suspects."""
    rows = np.flatnonzero(finite_rows(found.points.covariance))
    return ModelPoints(
        model=np.full(len(rows), model, dtype=np.int32),
        point=pair.point[rows],
        xyz=found.points.xyz[rows],
        covariance=found.points.covariance[rows],
        parallax_mm=found.parallax_mm[rows],
        active=found.active[rows],
    )


def _suspects(block: Block, pair: Pair, found: RelativeOrientation) -> Suspects:
    """Rejected points; the row is that of the right image's measurement, though the error may be in the left one."""
    rows = np.flatnonzero(~found.active)
    n = len(rows)
    return Suspects(
        kind=np.full(n, "image_point"),
        row=pair.right_row[rows],
        image=np.full(n, block.images.id[pair.right]),
        point=block.points.id[pair.point[rows]],
        stage=np.full(n, "relative_orientation"),
        size=found.error_mm[rows],
        unit=np.full(n, "mm"),
        sigma=found.error_sigma_mm[rows],
        test=found.test[rows],
        verdict=np.full(n, "rejected"),
    )
