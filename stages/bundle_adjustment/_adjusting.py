"""The adjustments of a bundle by its options: one, or those of a search for gross errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from aatri.adapters.bundle.bundle_input import with_parameters
from aatri.adapters.bundle.candidate_groups import candidate_groups
from aatri.adjustment.problem import SolverSettings
from aatri.artifacts.solution import VarianceComponents
from aatri.checks.after.rank_defect import rank_advice
from aatri.checks.at_start.exchanged_control import without_exchanged
from aatri.errors import ConvergenceError, GeometryError
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.kinds.catalogue import KindOptions
from aatri.observations.observed import ObservationSource
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.adjusted_terms import adjusted_with_terms, with_converged_terms
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.earlier_rejections import (
    failing_once,
    search_anew,
    with_datum_again,
    with_sets_again,
)
from aatri.orientation.bundle.blunders.robust import AdjustOptions, robustly
from aatri.orientation.bundle.from_afar import Restarts, adjust_bundle_from_afar
from aatri.orientation.bundle.groups.failed_search import (
    searched_again,
    without_mostly_rejected_image,
    without_wrong_image,
)
from aatri.orientation.bundle.groups.search import AcceptedGroup, search_with_groups
from aatri.orientation.bundle.observed_sigma0 import with_observed_sigma0
from aatri.orientation.bundle.parameter_estimates import column_kinds
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock, with_considered, with_readmission, without_idle_parameters
from aatri.orientation.bundle.settings import BundleSettings
from aatri.plugin import Context, Field

from ._variance_components import with_variance_components

if TYPE_CHECKING:
    from .bundle import BundleOptions


class AdjustmentOptions(KindOptions):
    """Options that all adjustments of rays have in common."""

    max_iterations: int | None = Field(
        None, ge=1, description="most iterations; null: 30, and 60 where it still makes progress"
    )
    tolerance: float = Field(
        1e-3, gt=0, le=1e-2, description="converged when no unknown moves by more than this times its sigma"
    )
    max_sigma0: float | None = Field(
        None,
        gt=1,
        description="a sigma0 beyond this is an error; null: 20; in `bundle`, where fitted standard deviations are "
        "used, 1 mrad over the stated one of a direction if that is more, and no error where a named cause explains it",
    )


GROSS_ERRORS = "`blunders: none` looks for no gross errors, and one of them is enough: try `blunders: robust_snooping`"

COARSE = 5.0
"""Bound of the Newton decrement of the adjustments on the way to gross errors."""


def adjusted_block(
    source: ObservationSource, inputs: BundleInput, options: BundleOptions, adjust: Callable[..., BundleResult]
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...], VarianceComponents | None]:
    """The adjusted block after all that the options ask for, the groups that the search found, variance components.

    `adjust` makes one adjustment of a block, by `AdjustOptions` that may be given; other starts are counted block by
    block.
    """
    adjust = partial(adjust, restarts=Restarts())
    done, groups = _searched(source, inputs, options, adjust)
    done = with_converged_terms(done, adjust, partial(adjust, adjusting=AdjustOptions(covariances=False)))
    done, components = with_variance_components(source.block, done, adjust, options.variance_components)
    return with_considered(done, adjust, partial(with_parameters, source)), groups, components


def _searched(
    source: ObservationSource, inputs: BundleInput, options: BundleOptions, adjust: Callable[..., BundleResult]
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]]:
    """The adjusted block after the search of the options, and the groups it found."""
    searching, groups = options.blunders, tuple[AcceptedGroup, ...]()
    if options.variance_components is not None and searching.sigmas == "estimated":
        searching = searching.model_copy(update={"sigmas": "tests"})  # the weights are for them to find

    adjust = failing_once(adjust)

    def single(block: BundleInput, squares: list[BundleResult] | None) -> AdjustedBlock:
        if searching.method == "none":
            return with_readmission(block, adjust)
        return search_anew(block, adjust, searching, options.tolerance, squares)

    in_groups = partial(
        search_with_groups, adjust=adjust, single=single, candidates_of=candidate_groups, options=searching
    )
    in_all = partial(with_datum_again, adjust=in_groups)

    def searched(block: BundleInput) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]]:
        try:
            done, groups = in_all(block)
        except (ConvergenceError, GeometryError) as failure:
            if searching.method == "none":
                failure.remedy = f"{GROSS_ERRORS}; else: {failure.remedy}" if failure.remedy else GROSS_ERRORS
                raise
            return searched_again(block, in_all, adjust, failure)
        if searching.method != "none" and (without := without_mostly_rejected_image(block, in_all, adjust, done)):
            return without
        most = options.max_sigma0
        if most is None or searching.method == "none" or groups or not done.result.adjusted.sigma0 * done.scale > most:
            return done, groups
        return without_wrong_image(block, in_all, adjust, most) or (done, groups)

    if searching.method == "robust":
        done = robustly(inputs, adjust, searching)
    else:
        inputs = with_sets_again(inputs if searching.method == "none" else without_exchanged(inputs))
        done, groups = searched(inputs)
    if options.self_calibration is None or not options.self_calibration.remove:
        return done, groups
    rebuilt, before = partial(with_parameters, source), done.notes
    undecided = any(kind != IMAGE_POINT for kind, _ in done.undecided)
    done = without_idle_parameters(done, adjust, rebuilt)
    if undecided and done.considered:  # parameters that are not worth keeping could take up what is wrong
        fewer = rebuilt(inputs, done.inputs.parameters)
        without_idle, groups = searched(fewer)
        removed = [note for note in done.notes if note not in before]
        done = replace(without_idle, notes=(*without_idle.notes, *removed), considered=done.considered)
    return done, groups


def with_one_factor(adjust: Callable[..., BundleResult]) -> Callable[..., BundleResult]:
    """Adjustments of which the last alone keeps its factor: before the next one that is given back.

    Whoever asks a result for a factor that was given back has it made again (`factor_of`).
    """
    close: list[Callable[[], None]] = []

    def once(
        block: BundleInput, adjusting: AdjustOptions = AdjustOptions(), restarts: Restarts | None = None
    ) -> BundleResult:
        while close:
            close.pop()()
        result = adjust(block, adjusting, restarts=restarts)
        if result.adjusted.factored is not None:
            close.append(result.adjusted.factored.factor.clear)
        return result

    return once


def adjusted(
    inputs: BundleInput,
    adjusting: AdjustOptions = AdjustOptions(),
    *,
    options: BundleOptions,
    context: Context,
    restarts: Restarts | None = None,
) -> BundleResult:
    """One adjustment; a rank defect with its remedy."""
    from_afar = partial(adjust_bundle_from_afar, restarts=restarts)
    adjust = adjust_bundle if adjusting.huber and adjusting.coarse else from_afar
    settings = _settings(options, adjusting, context)

    def once(block: BundleInput) -> BundleResult:
        return with_observed_sigma0(adjust(block, settings, reporter=context))

    def roughly(block: BundleInput) -> BundleResult:
        return adjust(block, replace(settings, covariances=False), reporter=context)

    try:
        return adjusted_with_terms(inputs, once, roughly)
    except GeometryError as error:
        names = tuple(name for p in inputs.parameters for name in p.labels)
        tied = not {"control", "position"}.isdisjoint(o.kind for o in inputs.observed)
        advice = rank_advice(error, names, column_kinds(inputs), free_datum=options.datum == "free", tied=tied)
        if not advice and options.datum == "given" and not tied:
            advice = "give control or observed positions, or set `datum: free` or `datum: minimal`"
        error.remedy = advice or error.remedy  # of its own class: the search tells an open datum by it
        raise


def _settings(options: BundleOptions, adjusting: AdjustOptions, context: Context) -> BundleSettings:
    searched = options.blunders.method != "none"
    covariances = searched or options.standard_deviations is not False or options.reliability
    covariances = adjusting.covariances and (covariances or options.variance_components is not None)
    solution = SolverSettings(
        max_iterations=options.max_iterations,
        tolerance=max(options.tolerance, COARSE) if adjusting.coarse else options.tolerance,
        near_tolerance=options.tolerance if adjusting.to_end_if_near else None,
        ordering=options.ordering,
        reproducible=options.reproducible,
        memory_gb=options.memory_gb,
        solver=options.solver,
        demands="standard deviations" if options.standard_deviations or options.reliability else "",
        checkpoint=context.checkpoint,
        parts=options.parts,
        workers=context.workers,
    )
    keep_factor = not searched  # a search would keep the factors of several adjustments
    return BundleSettings(
        options.datum,
        options.datum_over,
        covariances,
        keep_factor=keep_factor,
        keep_cheap_factor=adjusting.to_end_if_near,  # which may be the result, whose score tests need it
        huber=adjusting.huber,
        weights=adjusting.weights,
        solution=solution,
    )
