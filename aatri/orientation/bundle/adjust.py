"""Bundle block adjustment: all observations of all images together.

Unknowns are the poses of the images (X0, d), the ground points, which are eliminated point by point, and where wanted
further parameters: film corrections per image, sets of additional parameters, parameters of camera models, drift.
Observations are of any kind (`aatri.observations.kinds`): image points (collinearity), control coordinates, observed
positions, distances ..., and the priors of the weighted parameters. Exact coordinates are held, other exact
observations are constraints. Coordinates are reduced to an origin near the block before any arithmetic.

Source: Kraus, Photogrammetry; docs/formulas.md 4.5.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.covariance.score import with_factor
from aatri.adjustment.iterative.forecast import forecast, is_cheap
from aatri.adjustment.loss import Huber
from aatri.adjustment.openness.reach import scaled, within_reach
from aatri.adjustment.parts.adjust import AdjustedInParts, adjust
from aatri.adjustment.parts.cut import VetoOf
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE, CommonTurn, Poses
from aatri.orientation.bundle.block import BundleInput, Participants, taking_part, unknowns_of, with_own_observations
from aatri.orientation.bundle.free_datum import FreeDatum, free_covariances, onto_inner_constraints, with_minimum_datum
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult
from aatri.orientation.bundle.settings import BundleSettings, Datum
from aatri.orientation.bundle.shared_unknowns import separable_unknowns
from aatri.progress import SILENT, Reporter


def adjust_bundle(
    inputs: BundleInput, settings: BundleSettings = BundleSettings(), *, reporter: Reporter = SILENT
) -> BundleResult:
    """Adjust a block.

    Parameters
    ----------
    reporter : Reporter
        Of the progress.

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge.
    """
    observed = tuple(o if o.determined is None else o.determined(inputs.observed) for o in inputs.observed)
    inputs = replace(inputs, observed=observed)
    part = taking_part(inputs)
    start = part.start
    observed, raised_notes = _within_reach(inputs.observed, start)
    inputs = replace(inputs, observed=observed)
    poses = _free_poses(part.of[POSE], inputs.held_images, inputs.poses.position_m, settings.datum)
    chain = settings.solution.ordering in ("across_strips", "along_strips")  # textbooks number images by their strips
    places = inputs.numbering.place if chain and inputs.numbering is not None else inputs.poses.position_m
    unknowns, held_notes = separable_unknowns(inputs, part, unknowns_of(inputs, part, poses, places))
    records, constraints, vetoes = _records(observed, part, settings)
    if not any(u.free.any() for u in unknowns):
        raise GeometryError(
            "there is nothing to adjust: no image and no point has enough observations that tie it to others",
            remedy="give `image_points` in `from:`, and start values",
        )
    free = None
    if settings.datum == "free":
        datum_records = [r for r in records if not _is_ray(r)] + constraints
        marked = np.zeros(len(inputs.point_ids), dtype=bool) if inputs.marked is None else inputs.marked
        datum_values = _datum_of(inputs.datum, start)
        free = FreeDatum.of(unknowns, datum_records, datum_values, part.of, settings.datum_over, marked, part.absent)
    held_unknowns = unknowns if free is None else with_minimum_datum(free)

    def adjusted_from(values: State) -> Adjusted:
        return adjust(
            held_unknowns,
            records,
            values,
            constraints=constraints,
            vetoes=vetoes,
            curve=_common_turn(inputs, part, held_unknowns),
            covariances=settings.covariances,
            reporter=reporter,
            settings=settings.solution,
        )

    adjusted = adjusted_from(start)
    if (smaller := _without_undetermined(inputs, adjusted, settings, reporter)) is not None:
        return smaller
    if free is not None:
        adjusted = onto_inner_constraints(free, adjusted, adjusted_from)
    if settings.weights:  # least squares with other weights than those a priori has no sigma0
        count = sum(int((w < 1).sum()) for w in settings.weights)
        adjusted = replace(adjusted, down_weighted=count, sigma0=float("nan")) if count else adjusted
    covariances, notes = (
        settings.covariances and not adjusted.down_weighted,
        [*raised_notes, *held_notes, *adjusted.notes],
    )
    in_parts = isinstance(adjusted, AdjustedInParts)
    if covariances and not (adjusted.has_factor or in_parts):
        needed = forecast(adjusted.problem)
        text = _WITHOUT_FACTOR.format(needed.memory_bytes(spill=True) / 1e9, needed.factor_bytes / 1e9)
        notes.append(Note("warning", text))
        covariances = False
    keep = settings.keep_factor or (settings.keep_cheap_factor and is_cheap(adjusted.problem))
    if covariances and not in_parts and keep:
        adjusted = with_factor(adjusted)
    return _result(inputs, adjusted, part, covariances, free, tuple(notes))


def _common_turn(inputs: BundleInput, part: Participants, unknowns: Sequence[Unknowns]) -> CommonTurn | None:
    """How the block turns as a whole, where all its images have observations of their own; others turn about points."""
    if not with_own_observations(inputs.observed, len(part.of[POSE]))[part.of[POSE]].all():
        return None
    free = {u.name: u.free for u in unknowns if u.name in (POSE, POINT)}
    return CommonTurn(free) if len(free) == 2 else None


def _datum_of(datum: State | None, start: State) -> State:
    """The values onto which a free datum is fitted."""
    if datum is None:
        return start
    chosen, at_start = ((state[POSE].position_m, state[POINT]) for state in (datum, start))
    position, xyz = (np.where(np.isfinite(a), a, b) for a, b in zip(chosen, at_start))
    return {**start, POSE: replace(start[POSE], position_m=position), POINT: xyz}


def _without_undetermined(
    inputs: BundleInput, adjusted: Adjusted, settings: BundleSettings, reporter: Reporter
) -> BundleResult | None:
    """The block adjusted without the images and points that it leaves open; None if there are none.

    With them go points that have run away to infinity: where they are now nothing determines them.
    """
    problem = adjusted.problem
    set_aside = {name: blocks for name, blocks in problem.set_aside.items() if name in (POSE, POINT) and blocks.any()}
    if not set_aside:
        return None
    if problem.rays is not None and problem.layout.eliminated == POINT and problem.hold.any():
        runaway = np.isin(np.arange(len(inputs.point_ids)), problem.rays.block[problem.hold.any(axis=(1, 2))])
        set_aside[POINT] = set_aside.get(POINT, False) | runaway
    # A free datum is fitted onto its start; any other begins where it has come to.
    poses, xyz = (
        (inputs.poses, inputs.xyz_m) if settings.datum == "free" else (adjusted.state[k] for k in (POSE, POINT))
    )
    if POSE in set_aside:
        poses = poses.where(~set_aside[POSE])
    if POINT in set_aside:
        xyz = np.where(set_aside[POINT][:, None], np.nan, xyz)
    result = adjust_bundle(replace(inputs, poses=poses, xyz_m=xyz), settings, reporter=reporter)
    for name, others in result.set_aside.items():
        set_aside[name] = set_aside[name] | others if name in set_aside else others
    aside_notes = [note for note in adjusted.notes if note.sets_aside]
    return replace(result, notes=(*aside_notes, *result.notes), set_aside=set_aside)


_WITHOUT_FACTOR = (
    "no standard deviations: exact covariances need the factor of the normal equations, and this block was solved by "
    "conjugate gradients, without it; `solver: direct` gives them, in {:.2g} GB of memory and {:.2g} GB on disk"
)


def _within_reach(observed: tuple[Observed, ...], start: State) -> tuple[tuple[Observed, ...], list[Note]]:
    """Observations between points or images, with standard deviations that are not too small beside all others'."""
    candidates = [
        i
        for i, o in enumerate(observed)
        if len(o.records.touches) > 1 and not (o.exact or o.components or _is_ray(o.records))
    ]
    if not candidates:
        return observed, []
    other_records = [replace(o.records, active=o.records.active & ~np.bool_(o.exact)) for o in observed]
    factors = within_reach(other_records, candidates, start)
    raised, notes = list(observed), []
    for i, factor in factors.items():
        o = observed[i]
        far_rows = np.flatnonzero(factor < 1)
        sigmas = [np.nanmin(f) for f in (o.sigmas()[far_rows], o.sigmas()[far_rows] / factor[far_rows, None])]
        names = tuple(o.label(int(k)) for k in far_rows)
        text = (
            f"{o.kind}: the standard deviations of {several(len(far_rows), 'observation')} are too small beside "
            f"all others; raised from {sigmas[0]:.2g} {o.unit} to {sigmas[1]:.2g} {o.unit}"
        )
        notes.append(Note("note", text, names))
        raised[i] = replace(o, records=scaled(o.records, factor))
    return tuple(raised), notes


def _free_poses(image: Bool, held_images: Bool | None, position_m: Float, datum: Datum) -> Bool:
    """Which scalars of the poses are free, of the images that take part."""
    free = np.repeat((image if held_images is None else image & ~held_images)[:, None], 6, axis=1)
    if datum == "minimal" and image.any():
        first = int(np.argmax(image))
        offset_m = np.where(image[:, None], np.abs(position_m - position_m[first]), -1.0)
        farthest, axis = np.unravel_index(int(np.argmax(offset_m)), offset_m.shape)
        free[first] = False
        free[farthest, axis] = False
    return free


def _is_ray(records: Records) -> bool:
    """Whether records are image points; a distance from a station to a point joins the same, and sees the scale."""
    return records.name == IMAGE_POINT


def _records(
    observed: tuple[Observed, ...], part: Participants, settings: BundleSettings
) -> tuple[list[Records], list[Records], list[VetoOf | None]]:
    """Observations and constraints of what takes part, and why the observations would refuse a step."""
    vetoes: list[VetoOf | None] = []
    records: list[Records] = []
    constraints: list[Records] = []
    for i, (o, rows) in enumerate(zip(observed, part.rows)):
        if not len(rows) or (o.exact and not o.records.active[rows].any()):  # of what is rejected nothing is demanded
            continue
        named = replace(o.records, label=o.label)
        if settings.weights:
            named = scaled(named, np.sqrt(settings.weights[i]))
        chosen = named if len(rows) == len(o) else named.take(rows)
        if settings.huber is not None and not (o.components or o.exact):
            chosen = replace(chosen, loss=Huber(settings.huber))
        (constraints if o.exact else records).append(chosen)
        if not o.exact:
            vetoes.append(None if o.veto is None else _veto_of(o.veto, rows))
    return records, constraints, vetoes


def _veto_of(veto: VetoOf, rows: Int) -> VetoOf:
    """The veto of chosen rows."""
    return lambda chosen: veto(rows[chosen])


def _result(
    inputs: BundleInput,
    adjusted: Adjusted,
    part: Participants,
    covariances: bool,
    free: FreeDatum | None,
    notes: tuple[Note, ...],
) -> BundleResult:
    image, point = part.of[POSE], part.of[POINT]
    groups = {u.name: np.full((len(u.free), u.size, u.size), np.nan) for u in adjusted.problem.unknowns}
    groups.setdefault(POSE, np.zeros((0, 6, 6)))
    record_covariances: dict[int, Float] = {}
    if covariances:
        parts_covariances = adjusted.covariances if isinstance(adjusted, AdjustedInParts) else None
        marginal = parts_covariances or marginal_covariances(adjusted)
        group_covariances = marginal.groups if free is None else free_covariances(free, adjusted, marginal.groups)
        for name, values in group_covariances.items():
            adjusted_blocks = part.of[name] if name in (POSE, POINT) else np.ones(len(values), dtype=bool)
            groups[name][adjusted_blocks] = values[adjusted_blocks]
        places = [i for i, rows in enumerate(part.rows) if len(rows) and not inputs.observed[i].exact]
        record_covariances = dict(zip(places, marginal.records))
    adjusted = replace(adjusted, problem=adjusted.problem.without_lanes())  # a search keeps several results
    poses: Poses = adjusted.state[POSE]
    return BundleResult(
        poses.where(image).shifted(inputs.origin_m),
        np.where(point[:, None], adjusted.state[POINT] + inputs.origin_m, np.nan),
        groups,
        tuple(AdjustedParameters(p, adjusted.state[p.group], groups[p.group]) for p in inputs.parameters),
        tuple(_observations(o, part.rows[i], record_covariances.get(i)) for i, o in enumerate(inputs.observed)),
        image,
        point,
        adjusted,
        notes,
        free,
        part.absent,
    )


def _observations(o: Observed, rows: np.ndarray, record_covariance: Float | None) -> AdjustedObservations:
    used = np.zeros(len(o), dtype=bool)
    used[rows[o.records.active[rows]]] = True
    m = o.records.rows
    if record_covariance is not None and len(rows) == len(o):  # all rows, in their order
        return AdjustedObservations(o, rows, used, record_covariance)
    covariance = np.full((len(o), m, m), np.nan)
    if record_covariance is not None:
        covariance[rows] = record_covariance
    return AdjustedObservations(o, rows, used, covariance)
