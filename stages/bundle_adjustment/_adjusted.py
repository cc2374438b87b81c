"""A bundle from its artifacts to the adjusted block: what every stage does that ends with one."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.adapters.bundle.information_observed import (
    InformationShare,
    information_share,
    linearised_at,
    with_information,
)
from aatri.adapters.cameras.image_parameters import with_row_times
from aatri.adapters.solution import check_same_block
from aatri.adapters.suspects import inherited
from aatri.adjustment.records import residuals
from aatri.adjustment.statistics.limits import MAX_SIGMA0
from aatri.arrays import Bool, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.information import Information
from aatri.artifacts.solution import Solution, VarianceComponents
from aatri.artifacts.suspects import Suspects
from aatri.checks.after.exchanged_marks import exchanged_marks
from aatri.checks.at_start.information import check_frame, check_unknowns, standing_in
from aatri.checks.at_start.of_start import findings_at_start
from aatri.checks.at_start.orientations import few_oriented
from aatri.checks.finding import Finding, report
from aatri.errors import ConvergenceError, GeometryError
from aatri.ids import several
from aatri.notes import Note, tell
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.kinds.catalogue import options_without_data
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.positions import uses_positions
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.limits import MUCH_LESS
from aatri.orientation.bundle.groups.candidates import MARK
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.groups.limits import SEVERAL
from aatri.orientation.bundle.groups.search import AcceptedGroup
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.plugin import Context

from ._adjusting import adjusted, adjusted_block, with_one_factor
from ._self_calibration import ChosenSet, chosen_set, parameters_of

if TYPE_CHECKING:
    from .bundle import BundleOptions

FAILS_WITH = "no adjustment succeeds with what an earlier stage has left out altogether: it stays out"
STAYS_OUT = "what an earlier stage has left out altogether stays out: "
FITS_NOTHING = f"{STAYS_OUT}it fits nothing, and beside it more of all else would be left out"
BETTER_WITHOUT = f"{STAYS_OUT}all else fits far better without it"


@dataclass(frozen=True)
class AdjustedBundle:
    """An adjusted block with what it was made of."""

    source: ObservationSource
    done: AdjustedBlock
    groups: tuple[AcceptedGroup, ...]
    components: VarianceComponents | None
    chosen: ChosenSet | None
    suspects: Suspects
    """Of earlier stages."""
    share: InformationShare | None
    """Of another block's Information."""


def adjusted_bundle(
    block: Block,
    image_points: ImagePoints | None,
    initial: Solution | None,
    calibration: Solution | None,
    information: Information | None,
    options: BundleOptions,
    context: Context,
) -> AdjustedBundle:
    """Adjust a block, and tell what there is to say of its start."""
    check_same_block(block, image_points=image_points, initial=initial)
    searched = options.blunders.method != "none"
    suspects, notes = inherited(block, initial, taken_back=not searched)
    tell(notes, context)
    chosen = chosen_set(block, options.self_calibration, uses_positions(block, options.positions), calibration)
    parameters = parameters_of(block, image_points, options.interior_unknowns, chosen, calibration)
    tangent, shared = None, None
    if information is not None:
        check_frame(information, block)
        tangent, shared = information.tangent_m, linearised_at(information, block)
    source = observation_source(block, image_points, initial, parameters, tangent, shared=shared)
    source = with_row_times(source, options.readout_sigma, options.velocity_sigma)

    def inputs_with(suspects: Suspects, doubted: Int) -> tuple[BundleInput, InformationShare | None]:
        stated = _without_attitudes(bundle_input(source, options, suspects, searched=searched), doubted)
        return _with_information(source, stated, information, context)

    doubted: Int = np.zeros(0, dtype=np.int64)
    inputs, share = inputs_with(suspects, doubted)
    notes = [*options_without_data(block, options), *source.notes, *(n for o in inputs.observed for n in o.notes)]
    at_start = findings_at_start(source, inputs, of_the_block=initial is None)
    report([*notes, *at_start], context)
    named = [f.rows[ATTITUDE] for f in at_start if isinstance(f, Finding) and ATTITUDE in f.rows]
    if searched and named:
        tell([Note("note", "attitudes that are named begin as rejected, and come back where they fit")], context)
        doubted = np.concatenate(named)
        inputs, share = inputs_with(suspects, doubted)
    left_out, _ = inherited(block, initial, taken_back=not searched, groups_back=False)
    staying_out = left_out.verdict != suspects.verdict
    adjust = with_one_factor(partial(adjusted, options=options, context=context))
    try:
        done, groups, components = adjusted_block(source, inputs, options, adjust)
        fits = done.result.adjusted.sigma0 * done.scale <= MAX_SIGMA0
        if staying_out.any() and not (fits and any(_concerns_datum(g.group) for g in groups)):
            with contextlib.suppress(ConvergenceError, GeometryError):
                others = inputs_with(left_out, doubted)
                without = adjusted_block(source, others[0], options, adjust)
                compared = without[0].result, done.result, others[0].observed, suspects.kind[staying_out]
                reasons = ((FITS_NOTHING, spoils_others), (BETTER_WITHOUT, fits_far_better))
                if reason := next((text for text, holds in reasons if holds(*compared)), ""):
                    (done, groups, components), (inputs, share) = without, others
                    tell([_stays_out(reason, suspects, staying_out)], context)
                    suspects = left_out
    except (ConvergenceError, GeometryError) as error:
        try:
            if not staying_out.any():
                raise error
            inputs, share = inputs_with(left_out, doubted)
            done, groups, components = adjusted_block(source, inputs, options, adjust)
        except (ConvergenceError, GeometryError):
            # which may be the reason
            for wrong in [f for f in at_start if isinstance(f, Finding) and f.cause == "start_rays"]:
                if isinstance(error, ConvergenceError):
                    error.what, error.remedy = f"{wrong.what}; {error.what}", f"{wrong.remedy}; else {error.remedy}"
            report(exchanged_marks(block, image_points, inputs.poses, inputs.xyz_m), context)
            report(few_oriented(initial) if initial is not None else [], context)
            raise error from None
        tell([_stays_out(FAILS_WITH, suspects, staying_out)], context)
        suspects = left_out
    if share is not None and not done.result.observations[-1].used.any():
        raise GeometryError(
            "the Information takes no part: an image or point of it is not adjusted in this block",
            remedy="keep fewer images and points in it, or give this block what they need",
        )
    return AdjustedBundle(source, done, groups, components, chosen, suspects, share)


def _without_attitudes(inputs: BundleInput, rows: Int) -> BundleInput:
    """The block with some attitudes, (k,) rows of the exterior, rejected: a search tests them, and takes what fits."""
    observed = list(inputs.observed)
    for k, o in enumerate(observed):
        if o.kind == ATTITUDE and len(rows):
            rejected = np.isin(o.row, rows)
            observed[k] = o.again().without(rejected if o.rejected is None else rejected | o.rejected)
    return replace(inputs, observed=tuple(observed))


def _with_information(
    source: ObservationSource, inputs: BundleInput, information: Information | None, context: Context
) -> tuple[BundleInput, InformationShare | None]:
    if information is None:
        return inputs, None
    check_unknowns(information, source.block, inputs)
    twice = standing_in(information, source.block, inputs)
    share = information_share(information, inputs)
    count = sum(int(rows.sum()) for rows in twice)
    context.log(
        f"Information of block {information.block}: {several(information.observations, 'observation')}, "
        f"{several(len(information.unknowns), 'unknown')}; it has {several(count, 'observation')} of "
        "this block, counted once"
    )
    return with_information(inputs, share, twice), share


def _concerns_datum(group: Group) -> bool:
    """Whether a group may be why an earlier stage has left out all control or positions.

    What is wrong may be these, what they were held against, or a camera, as heights contradict a principal distance;
    not points of a neighbourhood, an image or a strip, nor a single mark.
    """
    return group.per != MARK and (group.kind != IMAGE_POINT or group.per == "camera")


def spoils_others(
    without: BundleResult, beside: BundleResult, stated: Sequence[Observed], kinds: Container[str]
) -> bool:
    """Whether what is observed of some kinds fits nothing, and the result with them does without several others.

    It fits nothing where that result has left it out, or uses it with residuals beyond `MAX_SIGMA0` of the standard
    deviations as stated. Several are `SEVERAL`: by one or two differ two searches of a block by chance.
    """
    count = np.zeros(2)
    for o, *of_results in zip(stated, without.observations, beside.observations):
        if o.kind not in kinds:
            count += [one.used.sum() for one in of_results]
            continue
        own = of_results[1]
        rows = np.flatnonzero(own.used)
        if not len(rows):
            continue
        sigma = (o if np.array_equal(own.observed.row, o.row) else own.observed).sigmas()[rows]
        v = residuals(own.observed.records, beside.adjusted.state, rows)
        tested = np.isfinite(v) & (sigma > 0)
        if not tested.any() or ((v[tested] / sigma[tested]) ** 2).mean() <= MAX_SIGMA0**2:  # exact ones hold
            return False
    return bool(count[0] >= count[1] + SEVERAL)


def fits_far_better(
    without: BundleResult, beside: BundleResult, stated: Sequence[Observed], kinds: Container[str]
) -> bool:
    """Whether what both results use of other kinds fits one without these far better than one with them.

    Residuals and redundancy of the same observations count, in their standard deviations as stated: those of `kinds`
    do not fit themselves, and a search may have enlarged all.
    """
    squares, redundancy = np.zeros(2), np.zeros(2)
    for o, *of_results in zip(stated, without.observations, beside.observations):
        same = all(np.array_equal(one.observed.row, o.row) for one in of_results)
        if o.kind in kinds or o.exact or not same:
            continue
        rows = np.flatnonzero(of_results[0].used & of_results[1].used)
        sigma = o.sigmas()[rows]
        for k, (one, result) in enumerate(zip(of_results, (without, beside))):
            v = residuals(one.observed.records, result.adjusted.state, rows)
            explained = np.nan_to_num(np.einsum("nii->ni", one.covariance[rows]))  # unknown: as if it were none
            squares[k] += ((v[sigma > 0] / sigma[sigma > 0]) ** 2).sum()
            redundancy[k] += (1.0 - explained[sigma > 0]).sum()
    factor = np.sqrt(np.divide(squares, redundancy, out=np.full(2, np.inf), where=redundancy > 0))
    return bool(factor[0] < MUCH_LESS * factor[1])


def _stays_out(text: str, suspects: Suspects, rows: Bool) -> Note:
    counts = Counter(suspects.kind[rows].tolist())
    return Note("warning", text, tuple(f"{n} {kind}" for kind, n in counts.items()))
