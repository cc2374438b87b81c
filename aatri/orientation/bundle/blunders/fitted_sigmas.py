"""A search with standard deviations and tails that fit the residuals: its adjustments before anything is rejected.

The standard deviations are those of `scaling`, estimated again until they stay, as long as nothing is far out: the
residuals that gross errors have smeared tell nothing of them, nor of the tails (`adjustment.statistics.long_tails`).
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.long_tails import Tail
from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.rejections import Rejections
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.scaling import Scaling
from aatri.orientation.bundle.blunders.search_notes import labels
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import TestedBlock
from aatri.orientation.bundle.result import BundleResult, from_result

HARMLESS = 2.0
"""Tests up to this many limits smear so little that no robust adjustment is needed."""

MOST_SCALINGS = 5
"""Adjustments until the standard deviations fit."""


class FittedSigmas(Rejections):
    """What a search rejects, with standard deviations that fit.

    Attributes
    ----------
    adjust : callable
    as_given : tuple of Observed
        The observations with the standard deviations given.
    scaling : Scaling
        Those in use.
    tails : tuple of Tail
        Of each class, by the last adjustment.
    smeared : bool
        Something is far out of the standard deviations that would fit, so that nobody knows which fit.
    """

    def __init__(self, block: BundleInput, adjust: Adjust, options: SearchOptions) -> None:
        super().__init__(block, options)
        self.adjust, self.as_given, self.scaling = adjust, self.all.observed, Scaling.of(block)
        self.tails: tuple[Tail, ...] = ()
        self.smeared = False

    def _with_fitting_sigmas(self, tried: TestedBlock) -> TestedBlock:
        """Adjusted with standard deviations that fit, where nothing is far out of them: else the residuals smear."""
        for _ in range(MOST_SCALINGS if self.options.sigmas != "given" else 0):
            asked = self.scaling.classes.scales(tried.result)
            if not (tried.small or self._harmful(tried, tried.active)):
                asked = self.scaling.classes.of_small_kinds(asked, tried.result)
            scaling, by = self.scaling.after(asked)
            self.smeared = self._harmful(tried, tried.active, self._of_classes(by))
            if self.smeared:
                break
            self._rescale(scaling, by, from_result(self.block, tried.result))
            if (by == 1.0).all():
                break
            self.block = replace(self.block, observed=self.all.without(self.block.observed, tried.active))
            tried = self._tested(self.adjust(self.block, AdjustOptions(coarse=True)), tried.active)
        return tried

    def _rescale(self, scaling: Scaling, by: Float, start: BundleInput) -> None:
        self.scaling = scaling
        if (by != 1.0).any():
            self.block = replace(start, observed=scaling.classes.with_factors(start.observed, by))
            self.all = replace(self.all, observed=tuple(o.again() for o in self.block.observed))

    def _with_sigmas_of_the_result(self, tried: TestedBlock) -> tuple[BundleInput, BundleResult]:
        """The block adjusted with those of the search, or as given where these were for the tests alone."""
        if self.options.sigmas == "estimated" or not self.scaling.changed.any():
            return tried.block, tried.result
        start = from_result(tried.block, tried.result)
        observed = tuple(replace(o, start=now.start) for o, now in zip(self.as_given, start.observed))
        block = replace(start, observed=self.all.without(observed, tried.active))
        return block, self.adjust(block, AdjustOptions())

    def _first(self, active: Bool) -> tuple[TestedBlock | None, Exception | None]:
        """Least squares with everything; None where that fails."""
        try:
            return self._tested(self.adjust(self.block, AdjustOptions(coarse=True)), active), None
        except (ConvergenceError, GeometryError) as error:
            return None, error

    def _tested(self, result: BundleResult, active: Bool) -> TestedBlock:
        """Least squares that gross errors may have smeared: the tails of its residuals are not those of the errors."""
        return TestedBlock(self.block, result, active, self.options, np.ones(len(active)))

    def _of_classes(self, factor: Float) -> Float:
        return self.all.smallest(self.scaling.classes.number, factor)

    def _tails(self, result: BundleResult, squares: BundleResult | None = None, *, anew: bool = True) -> Float:
        """Limit of each record over that of normal errors; a limit that the user has stated obeys.

        Not `anew`, no tail grows longer than it was: gross errors that come back smear, and would bring more back.
        """
        limit, classes = self.options.limit, self.scaling.classes
        if not self.options.counts:
            return np.ones(len(self.all.native))
        tails = classes.tails(result, squares, limit)
        self.tails = tails if anew else tuple(min(pair, key=lambda t: t.limit) for pair in zip(self.tails, tails))
        return self._of_classes(np.array([tail.limit for tail in self.tails]) / limit)

    def _tail_notes(self, use: Bool, test: Float) -> list[Note]:
        """Classes of observations whose errors have long tails, and what is used though normal errors are smaller."""
        limit, notes = self.options.limit, list[Note]()
        text = (
            "{}: errors have longer tails than normal ones (as Student's of {:.0f} degrees of freedom): gross is what "
            "is beyond {:.3g} sigma, not {:.3g}"
        )
        for k, (name, tail) in enumerate(zip(self.scaling.classes.names, self.tails)):
            if tail.limit <= limit:
                continue
            between = use & (test > limit) & self._in_class(k)
            names = [
                f"{label} ({w:.1f})"
                for o, which, of_kind in zip(self.all.observed, self.all.split(between), self.all.split(test))
                for label, w in zip(labels(o, which), of_kind[which].tolist())
            ]
            more = f"; {len(names)} are used that one of normal errors would not be, their |w|" if names else ""
            notes.append(Note("note", text.format(name, tail.freedom, tail.limit, limit) + more, tuple(names)))
        return notes

    def _in_class(self, number: int) -> Bool:
        """Records with a component of a class, (n,)."""
        parts = ((of_kind == number).any(axis=1) for of_kind in self.scaling.classes.number)
        return np.concatenate([np.zeros(0, dtype=bool), *parts])

    def _harmful(self, tried: TestedBlock, active: Bool, scale: Float | float = 1.0) -> bool:
        return bool((active & (tried.test > HARMLESS * self.options.limit * scale)).any())
