"""A block whose search for gross errors fails.

A point whose rays at the start miss each other by `SCATTERED` times as much as those of most points is none: two have
one number, or it is measured far off. Where there are few such points their rays begin as rejected, and the search is
made again; it takes back what fits.

Points that may as well be at infinity hardly move the rest. Least squares slows them down, while robust weights drive
them on: the search is made without them, as if they were not measured, and they come back afterwards, which is told.

An image whose points have others' numbers bends a small block until nothing stands out. Where sigma0 is beyond what is
refused, or nothing converges, each image is left out on trial; if the block fits without one, and never with it, the
search is made again as if this one had not been measured. So it is with an image that is open on the way only, and with
one of which the search has rejected most, where what is left of it bends the rest: without it half of what sigma0^2 is
above 1 is gone. What no observation determines of the whole, of most images, or of what images share, is as open
without one: none is tried.

Before that least squares of all observations may fit them. Without some observations, or by other weights, weak points
may run away, and with them the search. Nothing calls for rejections where sigma0 of least squares is not above what
chance explains: that result stands, and a warning says that nothing was searched for. Where sigma0 is larger the
failure stands.
"""

import contextlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.adjustment.statistics.limits import ALARM, MATTERS, MAX_SIGMA0
from aatri.arrays import Bool, Float, Int
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.geometry.intersection import intersect_rays
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.limits import MUCH_LESS
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.from_afar import is_of_most
from aatri.orientation.bundle.groups.limits import MOST_IMAGES_TRIED, MOST_RAYS_TRIED, MOST_SCATTERED, SCATTERED
from aatri.orientation.bundle.groups.search import AcceptedGroup
from aatri.orientation.bundle.result import AT_INFINITY, BundleResult, distance_tests, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock, with_readmission

Search = Callable[[BundleInput], tuple[AdjustedBlock, tuple[AcceptedGroup, ...]]]


def searched_again(
    block: BundleInput, search: Search, adjust: Adjust, failure: AatriError
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]]:
    """The search without scattered points, least squares without a search, or the search without a wrong image.

    Parameters
    ----------
    failure : AatriError
        Of the search.

    Raises
    ------
    AatriError
        The failure of the search, where none of these helps.
    """
    done = _with_all_images(block, search, adjust, failure)
    if done is None and not _is_open_without_any_image(block, failure):
        done = without_wrong_image(block, search, adjust)
    if done is None:
        raise failure
    return done


def _is_open_without_any_image(block: BundleInput, failure: AatriError) -> bool:
    """Whether what is open is of the whole, of most images or of none: that it is with fewer image points, too."""
    return (
        isinstance(failure, OpenError)
        and failure.exact
        and any(is_of_most(c, len(block.image_ids)) or _is_of_no_image(c, block) for c in failure.combinations)
    )


def _is_of_no_image(combination: OpenCombination, block: BundleInput) -> bool:
    """Whether only unknowns are open that images share, which are left when an image goes."""
    groups = {group for _, group in combination.unknowns}
    # film, parameters per image
    of_single_images = {u.name for o in block.observed for u in o.unknowns if u.joins == POSE}
    return bool(groups) and groups.isdisjoint({POSE, POINT} | of_single_images)


def _with_all_images(
    block: BundleInput, search: Search, adjust: Adjust, failure: AatriError
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]] | None:
    """The search without scattered points or those at infinity, or least squares; None where all of these fail."""
    fewer = without_scattered_points(block)
    if fewer is not block:
        with contextlib.suppress(ConvergenceError, GeometryError):
            return search(fewer)
    least_squares = _least_squares(block, adjust)
    if least_squares is None:
        return None
    done = without_far_points(block, least_squares.result, search, adjust)
    with_note = _without_search(least_squares, failure)
    return done if done is not None or with_note is None else (with_note, ())


def without_far_points(
    block: BundleInput, least_squares: BundleResult, search: Search, adjust: Adjust
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]] | None:
    """The search without the points that may as well be at infinity, which come back; None where there are none."""
    if block.rays is None or POINT not in least_squares.covariances:
        return None
    _, test = distance_tests(least_squares, block.rays)
    seen = np.bincount(block.rays.point[least_squares.ray_used], minlength=len(test)) > 0
    unlimited = seen & np.isnan(least_squares.point_covariance_m2).any(axis=(1, 2))  # that of fixed points is 0
    far = least_squares.point_adjusted & ((test < AT_INFINITY) | unlimited)
    if not far.any():
        return None
    before = from_result(block, least_squares)
    idle = [_rays_at(o, far, POINT) & o.records.active for o in before.observed]
    nearer = replace(before, observed=tuple(_switched(o, rows, False) for o, rows in zip(before.observed, idle)))
    with contextlib.suppress(ConvergenceError, GeometryError):
        done, groups = search(nearer)
        with_far_rays = tuple(_switched(o, rows, True) for o, rows in zip(done.inputs.observed, idle, strict=True))
        inputs = from_result(replace(done.inputs, observed=with_far_rays), done.result)
        inputs = replace(inputs, xyz_m=np.where(far[:, None], block.xyz_m, inputs.xyz_m))
        text = "points at infinity took no part in the search for gross errors, and are adjusted as measured"
        note = Note("warning", text, tuple(np.asarray(block.point_ids)[far].tolist()))
        result = adjust(inputs, AdjustOptions())
        return replace(done, inputs=inputs, result=result, notes=(*done.notes, note)), groups
    return None


def _switched(o: Observed, rows: Bool, on: bool) -> Observed:
    """With some rows in use, or not as if they had never been measured: nobody has rejected them."""
    active = o.records.active | rows if on else o.records.active & ~rows
    unreduced = None if o.unreduced is None else _switched(o.unreduced, rows, on)
    return replace(o, records=replace(o.records, active=active), unreduced=unreduced)


def mostly_rejected_images(rays: ImagePointRows | None, result: BundleResult) -> list[int]:
    """Images of which a search has rejected most image points, in a block of a sigma0 that chance does not explain.

    Those that lost the largest share come first; none of a large block.
    """
    adjusted, n = result.adjusted, len(result.image_adjusted)
    if rays is None or len(rays.image) > MOST_RAYS_TRIED:
        return []
    if not adjusted.sigma0 > max(MATTERS, sigma0_interval(max(adjusted.redundancy, 1), ALARM)[1]):
        return []
    measured, used = (np.bincount(rays.image[rows], minlength=n) for rows in (rays.active, result.ray_used))
    share = np.where(result.image_adjusted, used / np.maximum(measured, 1), 1.0)
    worst = np.argsort(share, kind="stable")[:MOST_IMAGES_TRIED]
    images: list[int] = worst[share[worst] < 0.5].tolist()
    return images


def without_mostly_rejected_image(
    block: BundleInput, search: Search, adjust: Adjust, done: AdjustedBlock
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]] | None:
    """The search without the image of which `done` has rejected most points and that explains its misfit; else None.

    It does where half of what sigma0^2 is above 1 is gone without it.
    """
    images = mostly_rejected_images(block.rays, done.result)
    fits = float(np.sqrt(MUCH_LESS * (1.0 + done.result.adjusted.sigma0**2))) * done.scale
    without = without_wrong_image(block, search, adjust, fits, images) if images else None
    return without if without is not None and without[0].result.adjusted.sigma0 * without[0].scale <= fits else None


def without_wrong_image(
    block: BundleInput,
    search: Search,
    adjust: Adjust,
    max_sigma0: float = MAX_SIGMA0,
    images: list[int] | None = None,
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]] | None:
    """The search without the rays of the image that is left out wherever the block fits; None where there is none.

    Parameters
    ----------
    max_sigma0 : float
        Of a block that fits.
    images : list of int, optional
        Those that may be wrong.
    """
    rays, fitting = block.rays, list[tuple[int, Bool, BundleInput]]()
    if rays is not None and images is None:
        images = _doubtful_images(block, rays)
    for image in images or ():
        of_image = np.arange(len(block.image_ids)) == image
        observed = tuple(_switched(o, _rays_at(o, of_image, POSE), False) for o in block.observed)
        fewer = replace(block, observed=observed)
        with contextlib.suppress(ConvergenceError, GeometryError):
            result = adjust(fewer, AdjustOptions(coarse=True))
            if result.adjusted.redundancy > 0 and result.adjusted.sigma0 <= max_sigma0:
                fitting.append((image, _without_rays_in_use(block, result), fewer))
    for image, lost, fewer in fitting:
        if not all((lost <= lost_too).all() for _, lost_too, _ in fitting):
            continue  # it is not left out whatever else is
        done: tuple[AdjustedBlock, tuple[AcceptedGroup, ...]] | None
        try:
            done = search(fewer)
        except (ConvergenceError, GeometryError) as failure:
            done = _with_all_images(fewer, search, adjust, failure)
        if done is None or not done[0].result.image_adjusted[image]:  # which is told of images that take no part
            return done
        text = "all image points of an image are left out: the block fits without them, and never with them"
        note = Note("warning", text, (str(block.image_ids[image]),))
        return replace(done[0], notes=(*done[0].notes, note)), done[1]
    return None


def _without_rays_in_use(block: BundleInput, result: BundleResult) -> Bool:
    """Images with image points of which none is used, (n_images,); positions and attitudes adjust them all the same."""
    rays, n = block.rays, len(block.image_ids)
    assert rays is not None
    measured, used = (np.bincount(rays.image[rows], minlength=n) > 0 for rows in (rays.active, result.ray_used))
    return np.asarray(measured & ~used)


def without_scattered_points(block: BundleInput) -> BundleInput:
    """The block with the rays of scattered points rejected; itself where there are none, or more than a few."""
    rays = block.rays
    if rays is None:
        return block
    use, of_ray = _misses(block, rays)
    miss = np.zeros(len(block.point_ids))
    np.maximum.at(miss, rays.point[use], of_ray)
    scattered = miss > SCATTERED * float(np.median(miss[miss > 0])) if (miss > 0).any() else miss > 0
    if not 0 < scattered.sum() <= max(1.0, MOST_SCATTERED * len(scattered)):
        return block
    return replace(block, observed=tuple(_without_rays(o, scattered) for o in block.observed))


def _misses(block: BundleInput, rays: ImagePointRows) -> tuple[Int, Float]:
    """Rows of the rays that the start places, and the sine by which each misses the point they have in common."""
    use = np.flatnonzero(rays.active & block.poses.oriented[rays.image])
    X0, direction, point = block.poses.position_m[rays.image[use]], rays.directions(block.poses, use), rays.point[use]
    away_m = intersect_rays(X0, direction, point, len(block.point_ids))[point] - X0
    length = np.linalg.norm(direction, axis=1) * np.linalg.norm(away_m, axis=1)
    return use, np.nan_to_num(np.linalg.norm(np.cross(direction, away_m), axis=1) / length)


def _doubtful_images(block: BundleInput, rays: ImagePointRows) -> list[int]:
    """All images of a small block; of a larger one those whose rays miss by most at the start; none of a large one."""
    images = np.unique(rays.image[rays.active])
    if len(images) > MOST_IMAGES_TRIED:
        use, of_ray = _misses(block, rays)
        of_images = (of_ray[rays.image[use] == image] for image in images)
        middle = [np.median(miss) if len(miss) else 0.0 for miss in of_images]
        images = images[np.argsort(-np.array(middle), kind="stable")[:MOST_IMAGES_TRIED]]
    return images.tolist() if len(rays.image) <= MOST_RAYS_TRIED else []


def _without_rays(o: Observed, points: Bool) -> Observed:
    """With the rays of some points rejected."""
    rejected = _rays_at(o, points, POINT)
    return o.again().without(rejected if o.rejected is None else rejected | o.rejected) if rejected.any() else o


def _rays_at(o: Observed, these: Bool, group: str) -> Bool:
    """Rays of some points, or images, among observations of a kind, (n,)."""
    groups = dict(o.records.touches)
    is_ray = not o.exact and {POSE, POINT} <= set(groups)
    return these[groups[group]] if is_ray else np.zeros(len(o), dtype=bool)


def _least_squares(block: BundleInput, adjust: Adjust) -> AdjustedBlock | None:
    """Least squares with all observations; None where it fails too."""
    try:
        return with_readmission(block, lambda inputs: adjust(inputs, AdjustOptions()))
    except (ConvergenceError, GeometryError):
        return None


def _without_search(done: AdjustedBlock, failure: AatriError) -> AdjustedBlock | None:
    """Least squares with a word on the search that failed; None where it does not fit."""
    redundancy, sigma0 = done.result.adjusted.redundancy, done.result.adjusted.sigma0
    if redundancy < 1 or not sigma0 <= sigma0_interval(redundancy)[1]:
        return None
    text = (
        f"gross errors were not searched for: the search failed ({failure.what}); least squares of all observations "
        f"fits with sigma0 {sigma0:.3g}, and is the result; `blunders: none` asks for it at once"
    )
    return replace(done, notes=(*done.notes, Note("warning", text)))
