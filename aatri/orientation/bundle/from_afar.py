"""Bundle adjustment from bad starts: where it fails, once more from a start that collinearity in object space gives.

The direct adjustment is tried first. If it does not converge, strays and ends with a sigma0 far above 1, or
turns images over (most of their points behind them), it is tried again: with relative control from a start without it;
then from starts by `space_start`: with rotations held at first or not, image points down-weighted or as they are. The
best result counts, at once if another start leads to the same. What still does not fit is oriented by resection to the
points that the other images determine. A result with images turned over is none: over flat ground their residuals are
as small as the right ones.

Of blocks with relative control the start is made without the shapes first, then with shapes fitted to its points.
Planes, lines and cylinders get their start from that of their points. Where images begin metres off, so do the points,
each its own way, and a cylinder fitted to them may be another one, through points that nearly fit. The other
observations alone give points that are right, to which every shape is fitted anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.arrays import Bool, finite_rows
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.ids import shown
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.complete_start import complete_start
from aatri.orientation.bundle.limits import FAR_SIGMA0, MOST_FRUITLESS, SAME_START
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.settings import BundleSettings
from aatri.orientation.bundle.space_start import start_in_space, turned_over
from aatri.progress import SILENT, Reporter

SAME = 1e-6
"""Costs that agree within this share are those of the same minimum."""

TRIALS = ((1e3, True), (1e3, False), (1.0, True), (1.0, False))
"""Factor on the standard deviations of the image points in object space; whether rotations are held at first."""


@dataclass
class Restarts:
    """What other starts have brought in the adjustments of one block with one thing and another left out."""

    fruitless: int = 0
    """Adjustments in turn that converged, and that no other start has bettered."""


def adjust_bundle_from_afar(
    inputs: BundleInput,
    settings: BundleSettings = BundleSettings(),
    *,
    reporter: Reporter = SILENT,
    restarts: Restarts | None = None,
) -> BundleResult:
    """Adjust a block whose start may be far off.

    Parameters
    ----------
    settings : BundleSettings
        Blocks without a given datum are adjusted from their start alone.
    restarts : Restarts, optional
        Of the adjustments of this block before: a search for gross errors adjusts it many times, and where these make
        the misfit no start betters it.

    Raises
    ------
    GeometryError
        If unknowns are not determined.
    ConvergenceError
        If no start converges, or images end up turned over.
    """
    failure: ConvergenceError | GeometryError | None = None
    best: BundleResult | None = None
    try:
        best = adjust_bundle(inputs, settings, reporter=reporter)
    except (ConvergenceError, GeometryError) as error:
        failure = error
    counted = restarts or Restarts()
    fruitless = best is not None and counted.fruitless >= MOST_FRUITLESS and not turned_over(inputs.rays, best).any()
    if settings.datum == "given" and not _trusted(inputs, best) and not fruitless:
        reason = failure.what if failure is not None else "another minimum is likely"
        reporter.log(f"adjusted again from a start by object space: {reason}")
        first, best = best, _best_restart(inputs, best, reporter, settings, left_open=_left_open(inputs, failure))
        counted.fruitless = counted.fruitless + 1 if first is not None and best is first else 0
    if best is None:
        assert failure is not None
        raise failure
    turned = turned_over(inputs.rays, best)
    if turned.any():
        raise ConvergenceError(
            f"images see most of their points behind them: {shown(np.asarray(inputs.image_ids)[turned])}",
            remedy="start from better initial values (`from: initial`); check the sign of c and the axes of the image",
        )
    return best


def _trusted(inputs: BundleInput, result: BundleResult | None, restarted: bool = False) -> bool:
    if result is None or turned_over(inputs.rays, result).any():
        return False
    # relative control has minima of its own: a cylinder through other points that nearly fit
    strayed = restarted or has_shapes(inputs.observed) or any(step.strayed for step in result.adjusted.history)
    return not (strayed and result.adjusted.sigma0 > FAR_SIGMA0)


def _best_restart(
    inputs: BundleInput,
    best: BundleResult | None,
    reporter: Reporter,
    settings: BundleSettings,
    *,
    left_open: frozenset[object] = frozenset(),
) -> BundleResult | None:
    """The best of the results so far and those of new starts; one without images turned over comes first.

    `left_open` is what the first adjustment has left open of the whole, or of most images: where that of a new start
    leaves it open too, it is the observations that do not determine it, and further starts end there.
    """
    if has_shapes(inputs.observed):
        try:
            inputs = start_without_shapes(inputs, settings, reporter)
            trial = adjust_bundle(inputs, settings, reporter=reporter)
            best = trial if best is None or _rank(inputs, trial) < _rank(inputs, best) else best
        except (ConvergenceError, GeometryError) as error:
            reporter.log(f"start without relative control: {error.what}")
        if _trusted(inputs, best, restarted=True):
            return best
    last_trial: tuple[BundleInput, BundleResult | AatriError] | None = None
    for factor, rotations_held in TRIALS if inputs.rays is not None else ():
        try:
            trial_start = start_in_space(inputs, factor, rotations_held)
            if last_trial is None or not _are_alike(last_trial[0], trial_start):
                last_trial = trial_start, _outcome(trial_start, reporter, settings)
            if isinstance(outcome := last_trial[1], AatriError):
                raise outcome
            trial = outcome
        except (ConvergenceError, GeometryError) as error:
            reporter.log(f"start by object space, sigmas of the image points times {factor:g}: {error.what}")
            if best is None and left_open and left_open == _left_open(inputs, error):
                return None
            continue
        same_minimum = best is not None and np.isclose(trial.adjusted.cost, best.adjusted.cost, rtol=SAME, atol=0.0)
        if best is None or _rank(inputs, trial) < _rank(inputs, best):
            best = trial
        if _trusted(inputs, best, restarted=True):
            return best
        if same_minimum and not _rank(inputs, best)[0]:
            break
    return _resected(inputs, best, reporter, settings)


def _outcome(start: BundleInput, reporter: Reporter, settings: BundleSettings) -> BundleResult | AatriError:
    """What an adjustment from a start gives, or why it gives nothing."""
    try:
        return adjust_bundle(start, settings, reporter=reporter)
    except (ConvergenceError, GeometryError) as error:
        return error


def _are_alike(start: BundleInput, other: BundleInput) -> bool:
    """Whether two starts differ by so little that they lead to the same."""
    centres_m = start.poses.position_m[finite_rows(start.poses.position_m)]
    extent_m = float(np.ptp(centres_m, axis=0).max()) if len(centres_m) else 0.0
    places = ((start.poses.position_m, other.poses.position_m), (start.xyz_m, other.xyz_m))
    return all(
        np.allclose(a, b, rtol=0.0, atol=SAME_START * extent_m, equal_nan=True) for a, b in places
    ) and np.allclose(
        start.poses.ground_from_image, other.poses.ground_from_image, rtol=0.0, atol=SAME_START, equal_nan=True
    )


def is_of_most(combination: OpenCombination, n_images: int) -> bool:
    """Whether what is open is of the whole, or of most images, so that it is with fewer image points, too."""
    images = [n for (_, group), n in zip(combination.unknowns, combination.counts) if group == POSE]
    return combination.of_whole or 2 * max(images, default=0) > n_images


def _left_open(inputs: BundleInput, error: AatriError | None) -> frozenset[object]:
    """Of what an adjustment has failed for: motions of the whole as one, else the unknowns that most images share."""
    combinations = error.combinations if isinstance(error, OpenError) else ()
    if not all(is_of_most(c, len(inputs.image_ids)) for c in combinations):
        return frozenset()
    return frozenset("whole" if c.of_whole else c.unknowns for c in combinations)


def _resected(
    inputs: BundleInput, best: BundleResult | None, reporter: Reporter, settings: BundleSettings
) -> BundleResult | None:
    """Images that do not fit, oriented anew by resection to the points that the others determine."""
    if best is None:
        return None
    misfitting = _misfits(inputs, best) if inputs.rays is not None else np.zeros(0, dtype=bool)
    if not misfitting.any() or 2 * misfitting.sum() > best.image_adjusted.sum():
        return best
    assert inputs.rays is not None
    rays = inputs.rays
    clean = rays.point[best.ray_used & ~misfitting[rays.image]]
    undetermined = (np.bincount(clean, minlength=len(inputs.point_ids)) < 2) & ~_observed_points(inputs)
    known_m = np.where(undetermined[:, None], np.nan, best.xyz_m - inputs.origin_m)
    poses, xyz = complete_start(rays, best.poses.shifted(-inputs.origin_m).where(~misfitting), known_m)
    try:
        trial = adjust_bundle(replace(inputs, poses=poses, xyz_m=xyz), settings, reporter=reporter)
    except (ConvergenceError, GeometryError) as error:
        reporter.log(f"start by resection of {shown(np.asarray(inputs.image_ids)[misfitting])}: {error.what}")
        return best
    complete = (trial.image_adjusted >= best.image_adjusted).all() and (
        trial.point_adjusted >= best.point_adjusted
    ).all()
    return trial if complete and _rank(inputs, trial) < _rank(inputs, best) else best


def _observed_points(inputs: BundleInput) -> Bool:
    """Points with observations of their own coordinates."""
    observed = np.zeros(len(inputs.point_ids), dtype=bool)
    for o in inputs.observed:
        if len(o.records.touches) == 1 and o.records.touches[0][0] == POINT:
            observed[o.records.touches[0][1]] = True
    return observed


def _misfits(inputs: BundleInput, result: BundleResult) -> Bool:
    """Images turned over, or with residuals far above those of the others."""
    n, total, count = len(inputs.image_ids), np.zeros(len(inputs.image_ids)), np.zeros(len(inputs.image_ids))
    for o in result.observations:
        touches = dict(o.observed.records.touches)
        if POSE in touches and POINT in touches:
            rows = np.flatnonzero(o.used)
            image = touches[POSE][rows]
            count += np.bincount(image, minlength=n)
            total += np.bincount(image, o.observed.records.standardised(result.adjusted.state)[rows], n)
    mean = total / np.maximum(count, 1)
    large = mean > max(FAR_SIGMA0, 3.0 * float(np.median(mean[result.image_adjusted])))
    return np.asarray(large | turned_over(inputs.rays, result))


def _rank(inputs: BundleInput, result: BundleResult) -> tuple[int, float]:
    turned = turned_over(inputs.rays, result)
    return int(turned.sum()), result.adjusted.cost


def has_shapes(observed: Sequence[Observed]) -> bool:
    """Whether some observations are of points of a shape."""
    return any(map(_is_shape, observed))


def _is_shape(o: Observed) -> bool:
    return o.refitted is not None and bool(len(o))


def start_without_shapes(inputs: BundleInput, settings: BundleSettings, reporter: Reporter) -> BundleInput:
    """The block with poses, points and shapes as the other observations give them.

    Raises
    ------
    GeometryError, ConvergenceError
        If the others do not determine the block.
    """
    other_observations = tuple(o for o in inputs.observed if not _is_shape(o))
    adjusted_without = adjust_bundle(
        replace(inputs, observed=other_observations),
        replace(settings, covariances=False, weights=()),
        reporter=reporter,
    )
    xyz = np.where(np.isfinite(adjusted_without.xyz_m), adjusted_without.xyz_m - inputs.origin_m, inputs.xyz_m)
    poses = adjusted_without.poses.shifted(-inputs.origin_m).where(adjusted_without.image_adjusted, inputs.poses)
    observed = []
    for o in inputs.observed:
        if o.refitted is not None and _is_shape(o):
            fitted = o.refitted({POSE: poses, POINT: xyz})
            o = fitted.without(o.rejected) if o.rejected is not None else fitted
        observed.append(o)
    return replace(inputs, poses=poses, xyz_m=xyz, observed=tuple(observed))
