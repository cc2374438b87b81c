"""What an adjusted bundle leaves in tables of its own, beside those of every Solution.

Observations that nothing controls, numbers that a search proposes, orders of elimination, covariances between chosen
points, and how many independent errors points have.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.limits import PREDICTED_REDUNDANCY
from aatri.adapters.observation_tables import uncontrolled_table
from aatri.adapters.solution import stacked
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.covariance.cross import joint_covariance
from aatri.adjustment.covariance.independent import independent_errors, independent_predictions
from aatri.adjustment.covariance.score import with_factor
from aatri.adjustment.records import whitened
from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.adjustment.statistics.record_tests import uncontrolled_directions
from aatri.adjustment.structure.bandwidth import OrderingFigures, ordering_figures
from aatri.adjustment.structure.index_problem import Ordering
from aatri.arrays import Float, Int
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import IndependentErrors, Orderings, PointCovariances, ProposedNumbers
from aatri.artifacts.suspects import Uncontrolled
from aatri.errors import ResourceError
from aatri.frames.tangent import TangentFrame
from aatri.ids import matching, several
from aatri.observations.control import KIND as CONTROL_KIND
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.blunders.swaps import are_image_points
from aatri.orientation.bundle.free_datum import transformation_of
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock, Key, with_keys
from aatri.progress import Reporter

CHAINS: tuple[Ordering, ...] = ("across_strips", "along_strips")
"""Orders of elimination of the textbook."""

MOST_CHOSEN = 3000
"""Points whose covariances with each other are kept: their matrix takes 650 MB, and as much again while it is made."""

NEW_POINTS, CHECK_POINTS, LEFT_OUT = "new", "check", "left_out"

MOST_COUNTED, MOST_WITH_TESTS = 5_000, 200_000
"""Points beyond which independent errors are many and their count not worth its time, or, where observations are
tested, its memory."""


def uncontrolled_of(result: BundleResult) -> Uncontrolled | None:
    """Observations in use with a direction whose redundancy number is below 0.01.

    Parameters
    ----------
    result : BundleResult
        None without covariances.
    """
    determined = [o for o in result.observations if not o.observed.exact and np.isfinite(o.covariance[o.used]).any()]
    if result.adjusted.down_weighted or not determined:
        return None
    return stacked([Uncontrolled.empty(), *map(_of_kind, determined)])


def _of_kind(adjusted: AdjustedObservations) -> Uncontrolled:
    o = adjusted.observed
    rows = adjusted.rows[adjusted.used[adjusted.rows]]
    records, m = o.records, o.records.rows
    R = np.eye(m) - adjusted.covariance[rows]
    observed = records.observed_components()[rows]
    if o.components:
        return _of_parameters(adjusted, rows, R)
    weak, least, direction = uncontrolled_directions(R, observed, records.whitener[rows])
    return uncontrolled_table(o, rows[weak], least, direction)


def _of_parameters(adjusted: AdjustedObservations, rows: Int, R: Float) -> Uncontrolled:
    """Of weighted parameters one by one: they have no common direction."""
    o, r = adjusted.observed, np.einsum("nii->ni", R)
    weighted = np.isfinite(o.sigmas()[rows])
    row, component = np.nonzero(weighted & (np.where(weighted, r, 1.0) < LEAST_CONTROLLED))
    label = np.array(o.components, dtype=np.str_)[component]
    return uncontrolled_table(o, rows[row], r[row, component], np.full((len(row), 1), np.nan), label)


def proposed_numbers(done: AdjustedBlock) -> ProposedNumbers:
    """All proposals of a search."""
    rows: list[tuple[Observed, int, str, bool]] = []
    observed = [o.observed for o in done.result.observations]
    for pair in done.swapped:
        for one, other in (pair, pair[::-1]):
            (o, row), (of_other, other_row) = (_place_of(observed, key) for key in (one, other))
            rows.append((o, row, str(of_other.names(np.array([other_row]))[1][0]), True))
    if done.renumbered and done.inputs.rays is not None:
        o = next(o for o in observed if are_image_points(o, done.inputs.rays))
        rows += [(o, one.row, str(done.inputs.point_ids[one.point]), False) for one in done.renumbered]
    if not rows:
        return ProposedNumbers.empty()
    named = [o.names(np.array([row])) for o, row, _, _ in rows]
    return ProposedNumbers(
        kind=np.array([o.kind for o, _, _, _ in rows]),
        row=np.array([o.row[row] for o, row, _, _ in rows], dtype=np.int32),
        image=np.array([str(image[0]) for image, _ in named]),
        point=np.array([str(point[0]) for _, point in named]),
        proposed=np.array([proposed for _, _, proposed, _ in rows]),
        exchanged=np.array([exchanged for _, _, _, exchanged in rows]),
    )


def _place_of(observed: list[Observed], key: Key) -> tuple[Observed, int]:
    """The observation with a key, and its place in it."""
    return next((o, int(np.argmax(has))) for o in observed if (has := with_keys(o, [key])).any())


def report_orderings(done: AdjustedBlock, used: Ordering, reporter: Reporter) -> Orderings | None:
    """Compare the order in use with those of the textbook, in the log and as a table; None without images."""
    problem, numbering = done.result.adjusted.problem, done.inputs.numbering
    if numbering is None:
        return None
    position = problem.layout.position.copy()
    vertex = problem.layout.vertex[POSE]
    position[vertex[vertex >= 0]] = numbering.place[vertex >= 0]
    figures_of_all = ordering_figures(problem, used, [name for name in CHAINS if name != used], position)
    textbook = numbering.textbook
    if textbook:
        n, N = numbering.images, numbering.strips
        better = "across" if n > 2 * N - 1 else "along"
        reporter.log(
            f"{several(N, 'parallel strip')} of up to {several(n, 'image')}; the textbook "
            f"numbers {better} the strips, n {n}, 2N - 1 {2 * N - 1}"
        )
    for k, figures in enumerate(figures_of_all):
        one_front = len(problem.tree.nodes) == 1 and k == 0
        reporter.log(_described(figures, textbook.get(figures.ordering), one_front))
    return Orderings(
        ordering=np.array([f.ordering for f in figures_of_all]),
        used=np.arange(len(figures_of_all)) == 0,
        textbook_images=np.array([textbook.get(f.ordering, -1) for f in figures_of_all], dtype=np.int32),
        images=np.array([f.half_bandwidth for f in figures_of_all], dtype=np.int32),
        unknowns=np.array([f.half_bandwidth_unknowns for f in figures_of_all], dtype=np.int64),
        border=np.array([f.border_unknowns for f in figures_of_all], dtype=np.int64),
        stored=np.array([f.stored for f in figures_of_all], dtype=np.int64),
        gflop=np.array([1e-9 * f.flops for f in figures_of_all]),
    )


def _described(f: OrderingFigures, textbook: int | None, one_front: bool) -> str:
    expected = f" (textbook {textbook})" if textbook is not None else ""
    band = f"half bandwidth {f.half_bandwidth} images{expected}, {f.half_bandwidth_unknowns} unknowns, "
    return (
        f"{f.ordering}{', one front' if one_front else ''}: {band if f.ordering in CHAINS else ''}"
        f"border {f.border_unknowns}, {f.stored:,} elements stored, {f.flops / 1e9:.3g} Gflop"
    )


def point_covariances(
    block: Block, result: BundleResult, frame: TangentFrame | None, patterns: Sequence[str]
) -> PointCovariances | None:
    """Covariances of the chosen points that are determined, in the frame of the block.

    Raises
    ------
    InputError
        If nothing matches a pattern.
    ResourceError
        If the matrix is too large.
    """
    if not patterns:
        return None
    determined = result.point_adjusted & np.isfinite(result.point_covariance_m2).all(axis=(1, 2))
    chosen = matching("point", block.points.id, patterns, "options of bundle_adjustment/bundle: point_covariances")
    rows = np.flatnonzero(chosen & determined)
    n = len(rows)
    if not n:
        return None
    if n > MOST_CHOSEN:
        raise ResourceError(
            f"covariances between {n} points, more than {MOST_CHOSEN}",
            where="options of bundle_adjustment/bundle: point_covariances",
            remedy="choose fewer points by their ids",
        )
    free = None if result.free is None else transformation_of(result.free, result.adjusted, determined)
    Q = joint_covariance(result.adjusted, POINT, rows, free).reshape(n, 3, n, 3).swapaxes(1, 2)
    if frame is not None:
        D = frame.derivatives_at(result.adjusted.state[POINT][rows])
        Q = D[:, None] @ Q @ D.swapaxes(1, 2)[None]
    if result.absent is not None:
        absent = result.absent[rows]
        Q[absent[:, None, :, None] | absent[None, :, None, :]] = np.nan
    first, second = np.triu_indices(n)
    return PointCovariances(rows[first].astype(np.int32), rows[second].astype(np.int32), Q[first, second])


def independent_errors_table(block: Block, result: BundleResult, *, tests: bool) -> IndependentErrors | None:
    """Counts of points that are no control, of check points, of control left out; None without their covariances.

    Held points have no errors, and are not counted. Whether a truth is known makes no difference: it changes nothing.

    Parameters
    ----------
    result : BundleResult
        In the frame of the adjustment.
    tests : bool
        Observations are tested too.
    """
    variance = np.einsum("nii->ni", result.covariances[POINT])
    determined = np.isfinite(variance) & (variance > 0) & np.isfinite(result.xyz_m)
    adjusted = result.adjusted
    most = MOST_WITH_TESTS if tests else MOST_COUNTED
    if not determined.any() or len(determined) > most or result.free is not None or adjusted.down_weighted:
        return None
    result, none = replace(result, adjusted=with_factor(adjusted)), np.zeros_like(variance)
    adjusted = result.adjusted
    counts: dict[str, Float] = {}
    ground = block.ground_points
    new = determined.all(axis=1) & ~block.points_given_as(CONTROL)
    if new.any():
        members = new[:, None] & np.ones(3, dtype=bool)
        counts[NEW_POINTS] = independent_errors(adjusted, POINT, members, variance, none)
    check = np.zeros_like(determined)
    check[ground.point] = ground.role == CHECK
    if check.any():
        variance_given = none.copy()
        variance_given[ground.point] = np.nan_to_num(np.einsum("nii->ni", ground.covariance_m2))
        counts[CHECK_POINTS] = independent_errors(adjusted, POINT, check & determined, variance, variance_given)
    if (left_out := _control_left_out(result)) is not None:
        counts[LEFT_OUT] = left_out
    if not counts:
        return None
    return IndependentErrors(points=np.array(list(counts)), count=np.array(list(counts.values())))


def _control_left_out(result: BundleResult) -> Float | None:
    """Of control points predicted each without itself, (3,); None where there is none that others predict."""
    adjusted = result.adjusted
    of_control = [o for o in result.observations if o.observed.kind == CONTROL_KIND and not o.observed.exact]
    control = next(
        (o for o in of_control if len(o.observed.records.touches) == 1 and o.observed.records.rows == 3), None
    )
    rows = np.flatnonzero(control.used) if control is not None else np.zeros(0, dtype=np.int64)
    if control is None or not len(rows) or not np.isfinite(control.covariance[rows]).all():
        return None
    records = control.observed.records
    block, observed = records.touches[0][1][rows], records.observed_components()[rows]
    _, (J,) = whitened(records, adjusted.state, rows)
    both = observed[:, :, None] & observed[:, None, :]
    R = np.where(both, np.eye(3) - control.covariance[rows], np.eye(3))
    predicted = np.linalg.eigvalsh(0.5 * (R + R.swapaxes(1, 2)))[:, 0] > PREDICTED_REDUNDANCY
    whitener = records.whitener[rows]
    L = whitener[:, :, None] * np.eye(3) if whitener.ndim == 2 else whitener
    back = np.linalg.inv(np.where(both, L, np.eye(3)))
    gain = np.where(both & predicted[:, None, None], back @ np.linalg.pinv(R), 0.0)
    return independent_predictions(adjusted, POINT, block, J, gain)
