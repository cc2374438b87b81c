"""Components joined by the points they have in common, and single images resected to what is known.

Two components become one by the robust similarity of their common points, where enough of these fit; where they share
images these give all but the scale, and the distances of a few common points from them give that; where common
points are few, all rays between them do (`few_points`). The whole is adjusted again. What stays apart is listed. Images
in no component that see enough known points are resected.
"""

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.unknowns import Ids
from aatri.arrays import Bool, Float, finite_rows
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.similarity import Similarity, robust_closed_form, transform
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.bundle.complete_start import complete_start
from aatri.orientation.graph.component import ImageComponent, refined, wide_mm
from aatri.orientation.graph.few_points import BY_POINT, by_few_points, conditions
from aatri.orientation.graph.limits import (
    FEWEST_DISTANCES,
    FEWEST_TO_JOIN,
    FITTING_SHARE,
    MOST_COMMON,
    MOST_WRONG,
    ON_A_LINE,
    SAME_SCALE,
)
from aatri.progress import Reporter


def joined(
    components: Sequence[ImageComponent], rays: ImagePointRows, image_ids: Ids, point_ids: Ids, reporter: Reporter
) -> tuple[list[ImageComponent], list[Note]]:
    """Components that cannot be joined any further, that of most images first, and what was done."""
    left = sorted(components, key=lambda c: -int(c.images.sum()))
    notes: list[Note] = []
    done: list[ImageComponent] = []
    while left:
        base, grown = left.pop(0), True
        while grown:
            grown = False
            for other in list(left):
                merged = _merged(base, other, rays)
                if merged is None:
                    continue
                poses, points, limits_mm = merged
                try:
                    refined_base = refined(rays, poses, image_ids, point_ids, limits_mm, reporter)
                    _held_together(refined_base, base, other, rays)
                except (ConvergenceError, GeometryError) as failed:
                    reporter.log(f"components are not joined: {failed.what}")
                    continue
                new = tuple(np.asarray(image_ids)[refined_base.images & other.images & ~base.images].tolist())
                text = f"{several(len(new), 'image')} joined to the others by {several(points, 'common point')}"
                notes.append(Note("note", text, new))
                base, grown = refined_base, True
                left.remove(other)
        base, resected = _with_resected(base, rays, image_ids, point_ids, reporter)
        if resected.any():
            ids = tuple(np.asarray(image_ids)[resected].tolist())
            text = f"{several(len(ids), 'image')} oriented by resection to the points of the others"
            notes.append(Note("note", text, ids))
        left = [c for c in left if (c.images & ~base.images).any()]
        done.append(base)
    return sorted(done, key=lambda c: -int(c.images.sum())), notes


def _merged(
    base: ImageComponent, other: ImageComponent, rays: ImagePointRows
) -> tuple[Poses, int, tuple[float | None, ...]] | None:
    """Poses of both in the frame of the first, the points that joined them, limits of rays; None where they do not."""
    limits_mm: tuple[float | None, ...] = (None, None)
    fit = _by_points(base, other) or _by_images(base, other)
    if fit is None:
        fit, limits_mm = _by_rays(base, other, rays), (wide_mm(rays), None)
    if fit is None:
        return None
    similarity, points = fit
    new = other.images & ~base.images
    position = np.where(new[:, None], transform(similarity, other.poses.position_m), base.poses.position_m)
    turned = similarity.rotation @ other.poses.ground_from_image
    rotation = np.where(new[:, None, None], turned, base.poses.ground_from_image)
    return Poses(position, rotation), points, limits_mm


def _by_points(base: ImageComponent, other: ImageComponent) -> tuple[Similarity, int] | None:
    """The similarity of common points, and how many of them fit it."""
    common = finite_rows(base.xyz) & finite_rows(other.xyz)
    x, X = other.xyz[common], base.xyz[common]
    if len(x) < FEWEST_TO_JOIN or _on_a_line(X):
        return None
    similarity, distance = robust_closed_form(x, X)
    fits = distance < FITTING_SHARE * float(np.linalg.norm(X - np.median(X, axis=0), axis=1).max())
    return (similarity, int(fits.sum())) if fits.sum() >= max(FEWEST_TO_JOIN, (1.0 - MOST_WRONG) * len(x)) else None


def _on_a_line(X: Float) -> bool:
    """Whether points, at least two, spread less than `ON_A_LINE` across the line along which they lie."""
    spread = np.linalg.svd(X - X.mean(axis=0), compute_uv=False)
    return bool(spread[1] < ON_A_LINE * spread[0])


def _by_images(base: ImageComponent, other: ImageComponent) -> tuple[Similarity, int] | None:
    """The same of common images: the scale is that of the distances of common points from them."""
    shared, common = base.images & other.images, finite_rows(base.xyz) & finite_rows(other.xyz)
    if not shared.any() or common.sum() < FEWEST_DISTANCES:
        return None
    (c, R), (C, S) = ((part.poses.position_m[shared], part.poses.ground_from_image[shared]) for part in (other, base))
    away, far = (
        np.linalg.norm(part.xyz[common][None] - centre[:, None], axis=2) for part, centre in ((other, c), (base, C))
    )
    ratio = np.median(np.log(far / np.maximum(away, 1e-300)), axis=0)
    fits = np.abs(ratio - np.median(ratio)) < SAME_SCALE
    if fits.sum() < max(FEWEST_DISTANCES, (1.0 - MOST_WRONG) * len(ratio)):
        return None
    scale = float(np.exp(np.median(ratio[fits])))
    turn = nearest_rotation(np.einsum("nij,nkj->ik", S, R))
    return Similarity((C - scale * c @ turn.T).mean(axis=0), scale, turn), int(fits.sum())


def _by_rays(base: ImageComponent, other: ImageComponent, rays: ImagePointRows) -> tuple[Similarity, int] | None:
    """The same of all rays between them, where they share no image, and common points are few or on a line."""
    common = finite_rows(base.xyz) & finite_rows(other.xyz)
    few = common.sum() <= MOST_COMMON or _on_a_line(base.xyz[common])
    if (base.images & other.images).any() or not few:
        return None
    return by_few_points(base, other, rays, BY_POINT * FEWEST_TO_JOIN, MOST_WRONG)


def _held_together(merged: ImageComponent, base: ImageComponent, other: ImageComponent, rays: ImagePointRows) -> None:
    """Refuse components without a common image whose rays to each other, or images, do not fit once all is adjusted.

    Raises
    ------
    GeometryError
    """
    if (base.images & other.images).any():
        return
    for part in (base, other):
        n, left = int(part.images.sum()), int((merged.images & part.images).sum())
        if left < (1.0 - MOST_WRONG) * n:
            raise GeometryError(f"of {n} images {left} fit", remedy="check the ids of their points")
    rows = np.flatnonzero(merged.kept & merged.images[rays.image])
    fitting = int(conditions(base, other, rays, rows).sum())
    if fitting < BY_POINT * FEWEST_TO_JOIN:
        raise GeometryError(
            f"{fitting} conditions of rays between them fit", remedy=f"{BY_POINT * FEWEST_TO_JOIN} are needed"
        )


def _with_resected(
    base: ImageComponent, rays: ImagePointRows, image_ids: Ids, point_ids: Ids, reporter: Reporter
) -> tuple[ImageComponent, Bool]:
    """With images that see enough known points."""
    visible = rays.active & finite_rows(base.xyz)[rays.point] & ~base.images[rays.image]
    if not (np.bincount(rays.image[visible], minlength=len(base.images)) >= 6).any():
        return base, np.zeros(len(base.images), dtype=bool)
    poses, _ = complete_start(rays, base.poses, base.xyz)
    new = finite_rows(poses.position_m) & ~base.images
    if not new.any():
        return base, new
    try:
        extended = refined(rays, poses, image_ids, point_ids, (None,), reporter)
    except (ConvergenceError, GeometryError) as failed:
        reporter.log(f"images are not resected: {failed.what}")
        return base, np.zeros(len(base.images), dtype=bool)
    return extended, extended.images & ~base.images
