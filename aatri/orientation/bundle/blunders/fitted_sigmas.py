"""A search with standard deviations and tails that fit the residuals: its adjustments before anything is rejected.

The standard deviations are those of `scaling`, estimated again until they stay, as long as nothing is far out: the
residuals that gross errors have smeared tell nothing of them, nor of the tails (`adjustment.statistics.long_tails`).
"""

import contextlib
from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.class_scales import ClassScales
from aatri.adjustment.statistics.long_tails import Tail
from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.limits import ALONE_BEYOND, HARMLESS, MOST_NOISY
from aatri.orientation.bundle.blunders.noisy_images import noisiest_images
from aatri.orientation.bundle.blunders.rejections import Rejections
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.scaling import SETTLED, Scaling
from aatri.orientation.bundle.blunders.search_notes import labels
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import TestedBlock
from aatri.orientation.bundle.result import BundleResult, from_result

MOST_SCALINGS = 5
"""Adjustments until the standard deviations fit."""


class FittedSigmas(Rejections):
    """What a search rejects, with standard deviations that fit.

    Attributes
    ----------
    adjust : callable
    tolerance : float
        Bound of the Newton decrement of the result.
    as_given : tuple of Observed
        The observations with the standard deviations given.
    scaling : Scaling
        Those in use.
    tails : tuple of Tail
        Of each class, by the last adjustment; none where it has not told them, or other classes' ones.
    smeared : bool
        Something is far out of the standard deviations that would fit, so that nobody knows which fit.
    """

    def __init__(self, block: BundleInput, adjust: Adjust, options: SearchOptions, tolerance: float) -> None:
        super().__init__(block, options)
        self.tolerance = tolerance
        self.adjust, self.a_priori_observed, self.scaling = adjust, self.all.observed, Scaling.of(block)
        self.tails: tuple[Tail, ...] = ()
        self.smeared = False

    def _with_fitting_sigmas(self, tested: TestedBlock) -> TestedBlock:
        """Adjusted with standard deviations that fit, where nothing is far out of them: else the residuals smear.

        A noisy image has its own where that leaves nothing of it above the limit: gross errors of an image smear its
        rest, and are for a robust adjustment to tell from noise. Else all is as if nobody had tried.
        """
        scales = None if self.options.sigmas == "given" else self.scaling.classes.scales(tested.result)
        if scales is not None and (loosened := self._with_firm_kind_looser(tested, scales)) is not tested:
            tested, scales = loosened, None
        before = self.scaling, self.block, self.all
        apart = self._with_noisy_image_apart(tested)
        fitted = self._with_scales(apart, scales if apart is tested else None)
        if apart is tested:
            return fitted
        of_images = self._in_classes(self.scaling.classes.of_image)
        above_limit = bool((fitted.active & of_images & (fitted.test > self.options.w_limit)).any())
        if self.scaling.noisy and not (self.smeared or above_limit):
            return fitted
        noisy = self.scaling.noisy
        self.scaling, self.block, self.all = before
        fitted = self._with_scales(tested)
        self.smeared |= noisy
        return fitted

    def _with_scales(self, tested: TestedBlock, scales: ClassScales | None = None) -> TestedBlock:
        """Adjusted until the scales of the classes stay, or something is far out of them; the first may be known."""
        for _ in range(MOST_SCALINGS if self.options.sigmas != "given" else 0):
            scales = scales or self.scaling.classes.scales(tested.result)
            scaling, factor = self._scaling_after(scales, tested)
            self.smeared = self._is_harmful(tested, tested.active, self._smallest_factors(factor))
            if self.smeared:
                break
            self._rescale(scaling, factor, from_result(self.block, tested.result))
            if (factor == 1.0).all():
                break
            tested, scales = self._adjusted_again(tested), None
        return tested

    def _scaling_after(
        self, scales: ClassScales, tested: TestedBlock | None, most: float = np.inf
    ) -> tuple[Scaling, Float]:
        """With what the residuals ask for, and the factors that this changes by.

        The kind of most redundancy is alone at first where it is far off, as residuals of the others are of its errors.
        Small kinds come after the others, whose errors would be taken for theirs, and where none of these is far out.
        Nothing of them changes where one would by a factor of `most` or more.
        """
        scaling, factor = self.scaling.after(scales)
        if abs(np.log(factor[scales.main])) > np.log(ALONE_BEYOND):
            kind = self.scaling.classes.kind
            scaling, factor = self.scaling.after(scales.of(kind == kind[scales.main]))
        if tested is None or tested.low_redundancy or (factor != 1.0).any():
            return scaling, factor
        others = tested.active & ~self._in_classes(self.scaling.classes.in_small_kinds(scales))
        if self._is_harmful(tested, others):
            return scaling, factor
        with_small_kinds = self.scaling.after(self.scaling.classes.of_small_kinds(scales, tested.result))
        return (scaling, factor) if with_small_kinds[1].max() >= most else with_small_kinds

    def _with_firm_kind_looser(self, tested: TestedBlock, scales: ClassScales) -> TestedBlock:
        """With standard deviations that fit of a kind of little redundancy, where with these all else fits.

        Positions given with 1 mm that err by 0.1 m bend all else. Nothing changes where it may be either of two kinds.
        """
        classes, before, fitting = self.scaling.classes, (self.scaling, self.block, self.all), []
        if tested.low_redundancy or self._fits(tested, scales):
            return tested
        as_given = replace(scales, estimable=np.zeros(len(classes.names), dtype=bool))
        for kind in np.unique(classes.kind[classes.in_small_kinds(as_given)]).tolist():
            trial = tested
            with contextlib.suppress(ConvergenceError, GeometryError):
                for _ in range(MOST_SCALINGS):
                    scaling, factor = self.scaling.after(classes.of_small_kinds(as_given, trial.result, kind))
                    if (factor == 1.0).all():
                        break
                    self._rescale(scaling, factor, from_result(self.block, trial.result))
                    trial = self._adjusted_again(trial)
                if trial is not tested and self._fits(trial, self.scaling.classes.scales(trial.result)):
                    fitting.append((trial, self.scaling, self.block, self.all))
            self.scaling, self.block, self.all = before
        if len(fitting) == 1:
            tested, self.scaling, self.block, self.all = fitting[0]
        return tested

    def _fits(self, tested: TestedBlock, scales: ClassScales) -> bool:
        """Whether nothing is far out, and no class asks for larger standard deviations."""
        _, factor = self.scaling.after(scales)
        return not ((factor > 1.0).any() or self._is_harmful(tested, tested.active))

    def _adjusted_again(self, tested: TestedBlock) -> TestedBlock:
        self.block = replace(self.block, observed=self.all.without(self.block.observed, tested.active))
        return self._tested(self.adjust(self.block, AdjustOptions(coarse=True)), tested.active)

    def _with_noisy_image_apart(self, tested: TestedBlock) -> TestedBlock:
        """With standard deviations of its own for an image, or a strip, that seems noisy."""
        before = self.scaling, self.block, self.all
        if not self._takes_image_apart(tested.result, None):
            return tested
        with contextlib.suppress(ConvergenceError, GeometryError):  # a trial
            return self._adjusted_again(tested)
        self.scaling, self.block, self.all = before
        return tested

    def _takes_image_apart(self, result: BundleResult, least_squares: BundleResult | None) -> bool:
        """Whether an image seems noisy, whose points have standard deviations of their own from here."""
        classes = self.scaling.classes
        if self.options.sigmas == "given" or len(classes.images) >= min(
            MOST_NOISY, len(self.block.image_ids) // 10 + 1
        ):
            return False
        strip = None if self.block.images is None else self.block.images.strip
        images = noisiest_images(result, least_squares, classes.number, classes.images, strip)
        if not len(images):
            return False
        name = (
            f"image {self.block.image_ids[images[0]]}"
            if strip is None or len(images) == 1
            else f"strip {strip[images[0]]}"
        )
        self.tails = ()  # of other classes than there are from here
        scaling, factor = self.scaling.with_images(self.all.observed, images, name)
        self._rescale(scaling, factor, from_result(self.block, result))
        return True

    def _rescale(self, scaling: Scaling, factor: Float, start: BundleInput) -> None:
        self.scaling = scaling
        if (factor != 1.0).any():
            self.block = replace(start, observed=scaling.classes.with_factors(start.observed, factor))
            self.all = replace(self.all, observed=tuple(o.again() for o in self.block.observed))

    def _final_adjustment(self, tested: TestedBlock) -> tuple[BundleInput, BundleResult]:
        """The block adjusted with those of the search, or as given where these were for the tests alone.

        Those of the search are of most errors; the result has those of all that are used, tails included.
        """
        if self.options.sigmas == "estimated":
            factor = self._factors_of_tails(tested.result)
            if (factor == 1.0).all():
                return tested.block, tested.result
            scaling = replace(self.scaling, factor=self.scaling.factor * factor)
            self._rescale(scaling, factor, from_result(tested.block, tested.result))
            block = replace(self.block, observed=self.all.without(self.block.observed, tested.active))
            return block, self.adjust(block, AdjustOptions())
        if not self.scaling.changed.any():
            return tested.block, tested.result
        start = from_result(tested.block, tested.result)
        observed = tuple(replace(o, start=current.start) for o, current in zip(self.a_priori_observed, start.observed))
        block = replace(start, observed=self.all.without(observed, tested.active))
        return block, self.adjust(block, AdjustOptions())

    def _factors_of_tails(self, result: BundleResult) -> Float:
        """How much larger than those of most errors standard deviations are with the tails that are used, (g,).

        Of classes whose standard deviations are not those given: these obey.
        """
        v, r, group = self.scaling.classes.residuals(result, None)
        n = len(self.scaling.factor)
        usable = (group >= 0) & np.isfinite(v) & np.isfinite(r)
        squares, redundancy = (np.bincount(group[usable], x[usable], n) for x in (v**2, r))
        factor = np.sqrt(squares / np.where(redundancy > 0, redundancy, np.inf))
        has_tail = np.array([tail.limit > self.options.w_limit for tail in self.tails] or [False] * n)
        return np.where(self.scaling.changed & has_tail & (factor > SETTLED), factor, 1.0)

    def _initial_least_squares(self, active: Bool) -> TestedBlock | None:
        """Least squares with everything; None where that fails."""
        try:
            return self._tested(self.adjust(self.block, AdjustOptions(coarse=True, to_end_if_near=True)), active)
        except (ConvergenceError, GeometryError):
            return None

    def _tested(self, result: BundleResult, active: Bool) -> TestedBlock:
        """Least squares that gross errors may have smeared: the tails of its residuals are not those of the errors."""
        return TestedBlock(self.block, result, active, self.options, np.broadcast_to(1.0, len(active)))

    def _smallest_factors(self, factor: Float) -> Float:
        return self.all.smallest(self.scaling.classes.number, factor)

    def _tails(self, result: BundleResult, *, anew: bool = True) -> Float:
        """Limit of each record over that of normal errors; a limit that the user has stated obeys.

        Not `anew`, no tail grows longer than it was: gross errors that come back smear, and would bring more back.
        """
        limit, classes = self.options.w_limit, self.scaling.classes
        if self.options.limit is not None:
            return np.broadcast_to(1.0, len(self.all.native))
        tails = classes.tails(result, limit)
        self.tails = (
            tails
            if anew or not self.tails
            else tuple(min(pair, key=lambda t: t.limit) for pair in zip(self.tails, tails, strict=True))
        )
        return self._smallest_factors(np.array([tail.limit for tail in self.tails]) / limit)

    def _tail_notes(self, use: Bool, test: Float) -> list[Note]:
        """Classes of observations whose errors have long tails, and what is used though normal errors are smaller."""
        limit, notes = self.options.w_limit, list[Note]()
        text = (
            "{}: errors have longer tails than normal ones (as Student's of {:.0f} degrees of freedom): gross is what "
            "is beyond {:.3g} sigma, not {:.3g}"
        )
        for k, (name, tail) in enumerate(zip(self.scaling.classes.names, self.tails)):
            if tail.limit <= limit:
                continue
            between = use & (test > limit) & self._in_classes(np.arange(len(self.tails)) == k)
            names = [
                f"{label} ({w:.1f})"
                for o, above_rows, kind_values in zip(self.all.observed, self.all.split(between), self.all.split(test))
                for label, w in zip(labels(o, above_rows), kind_values[above_rows].tolist())
            ]
            suffix = f"; {len(names)} are used that one of normal errors would not be, their |w|" if names else ""
            notes.append(Note("note", text.format(name, tail.freedom, tail.limit, limit) + suffix, tuple(names)))
        return notes

    def _in_classes(self, classes: Bool) -> Bool:
        """Records with a component of one of the classes, (n,)."""
        parts = (np.append(classes, False)[number].any(axis=1) for number in self.scaling.classes.number)
        return np.concatenate([np.zeros(0, dtype=bool), *parts])

    def _is_harmful(self, tested: TestedBlock, active: Bool, scale: Float | float = 1.0) -> bool:
        return bool((active & (tested.test > HARMLESS * self.options.w_limit * scale)).any())

    def solve(self, previous: TestedBlock | None, use: Bool) -> TestedBlock:
        """Adjusted by least squares with some records, from where an earlier adjustment has come to."""
        return self._with_all_accuracy([] if previous is None else [previous], use)

    def _with_all_accuracy(self, start: list[TestedBlock], use: Bool) -> TestedBlock:
        """`solve` from an adjustment that is taken out, and not kept while the other is made."""
        tested = start.pop() if start else None
        if tested is not None and (use == tested.active).all() and self._converged(tested.result):
            return tested
        anew = tested is None
        block = self.block if tested is None else from_result(self.block, tested.result)
        del tested
        block = replace(block, observed=self.all.without(block.observed, use))
        result = self.adjust(block, AdjustOptions())
        return TestedBlock(block, result, use, self.options, self._tails(result, anew=anew))

    def _converged(self, result: BundleResult) -> bool:
        return result.adjusted.history[-1].decrement <= self.tolerance
