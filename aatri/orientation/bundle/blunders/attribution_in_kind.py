"""What is out of control, positions, distances ... is tried against the others of its kind: each is left out in turn.

The rejected record is put back and the block adjusted. There the gain of leaving out each one of the kind is known, in
the linear model exactly, whatever the start, the path and the order (`adjustment.statistics.leave_one_out`). If another
gains more it goes instead. If several gain the same nothing tells which is wrong: all go, if the block is determined
as well without them, else all stay (two contradicting bars: nothing else gives the scale), with standard deviations by
which they agree: with their own they would bend the block, and its rays would seem wrong. All stay too where they gain
little; they are named either way. So it is with the worst of a kind of which more disagrees than its redundancy answers
for, so that none was rejected: one of three control points.

Only a record that leaves some other of its kind all but untested can be taken for it: with correlation rho of their
tests gain_j = rho^2 gain_i, and leaving i out takes rho^2 of j's redundancy. The others are clear without that.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.statistics.leave_one_out import as_good
from aatri.adjustment.statistics.limits import SEPARABLE
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.observations.observed import NEARLY_EXACT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords, is_ray
from aatri.orientation.bundle.blunders.exact_coordinates import softened
from aatri.orientation.bundle.blunders.limits import DOUBT, SOFT_IN_TRIAL
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.search_notes import labels
from aatri.orientation.bundle.blunders.tested_block import TestedBlock, gains_of
from aatri.orientation.bundle.result import from_result
from aatri.orientation.bundle.variance_groups import with_factor

MOST = 12
"""Rejected records of a kind up to which each is tried: where there are more the others tell them apart."""

STAY = (
    "without them the block is not determined, so all of them are used{how}: measure another, or take the wrong one "
    "out of its table"
)

NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class AttributionInKind:
    """What the trials have come to."""

    tested: TestedBlock
    """Adjusted with what is active now."""
    undecided: Bool
    """(n,). Left out though only one of them is wrong."""
    kept: Bool
    """(n,). Used though one of them is wrong."""
    notes: tuple[Note, ...]


def attributed_in_kind(
    tested: TestedBlock, undecided: Bool, exchanged: Bool, records: AllRecords, adjust: Adjust, above_limit: Bool
) -> AttributionInKind:
    """Try what is out, and the worst that is used though it is above the limit, against the others of its kind.

    Parameters
    ----------
    tested : TestedBlock
        The end of a search.
    undecided : (n,) bool
        Left out by it though only some of them are wrong.
    exchanged : (n,) bool
        Left out, and fitting with each other's numbers: these are wrong, whatever else would explain as much.
    above_limit : (n,) bool
        Used, as the redundancy of the kind does not answer for so many.
    """
    state = _Attribution(tested, undecided, records, adjust)
    for kind in dict.fromkeys(o.kind for o in records.observed):
        places = [i for i, o in enumerate(records.observed) if o.kind == kind and not is_ray(o)]
        if places:
            state.try_kind(places, exchanged, above_limit)
    return AttributionInKind(state.tested, state.undecided, state.kept, tuple(state.notes))


class _Attribution:
    def __init__(self, tested: TestedBlock, undecided_before: Bool, records: AllRecords, adjust: Adjust) -> None:
        self.tested, self.undecided_before, self.records, self.adjust = tested, undecided_before, records, adjust
        self.undecided, self.kept = np.zeros_like(undecided_before), np.zeros_like(undecided_before)
        self.notes: list[Note] = []

    def try_kind(self, places: list[int], exchanged: Bool, above_limit: Bool) -> None:
        """Try all of a kind that are out, and the worst of those above the limit."""
        rows = np.concatenate([np.arange(part.start, part.stop) for i in places for part in [self.records.parts[i]]])
        rejected = rows[self.records.native[rows] & ~self.tested.active[rows] & ~exchanged[rows]]
        contradicting = rows[self.tested.active[rows] & above_limit[rows]]
        if len(contradicting):
            worst = int(contradicting[np.argmax(self.tested.test[contradicting])])
            if self._is_confusable(places, worst):
                self._try(places, rows, worst)
        for row in rejected.tolist() if len(rejected) <= MOST else ():
            if not self.tested.active[row] and not self.undecided[row] and self._is_confusable(places, row):
                self._try(places, rows, row)

    def _is_confusable(self, places: list[int], row: int) -> bool:
        """Whether some other of the kind is left all but untested without this one."""
        i, k = self._place(places, row)
        observations = self.tested.result.observations[i]
        if self.records.observed[i].holds is not None:
            return True
        gain = float(gains_of(observations, self.tested.result.adjusted.state, np.array([k]))[0])
        if not np.isfinite(gain):
            return False
        for other in (self.tested.result.observations[p] for p in places):
            H = other.covariance[other.used]
            R = np.eye(H.shape[1]) - H[np.isfinite(H).all(axis=(1, 2))]
            if len(R) and np.linalg.eigvalsh(R).min() < SEPARABLE / max(gain, SEPARABLE):
                return True
        return False

    def _try(self, places: list[int], rows: Int, row: int) -> None:
        use = (
            self.tested.active | self._at_points_of([row]) | (self.undecided_before & self._at_points_of(rows.tolist()))
        )
        use[rows] = self.tested.active[rows]
        use[row] = True
        soft_m = self._soft(*self._place(places, row))
        if np.isnan(soft_m):
            return
        try:
            with_record = self._adjusted(use, dict.fromkeys(places, soft_m))
        except (GeometryError, ConvergenceError):
            return
        gain = np.concatenate([_gains(with_record, p, self.records) for p in places])
        best_rows = rows[as_good(np.where(use[rows], gain, np.nan))]
        if len(best_rows) == 1 and best_rows[0] == row:
            return
        ambiguous = len(best_rows) > 1 and np.nanmax(gain[np.isin(rows, best_rows)]) <= DOUBT**2
        use_without = use.copy()
        use_without[best_rows] = False
        reduced = None if ambiguous else self._without(use_without, with_record, best_rows)
        if reduced is not None:
            self.tested = reduced
            self.undecided[best_rows] = len(best_rows) > 1
            return
        use |= self._at_points_of(best_rows.tolist())
        factor = (
            1.0 if ambiguous else self._agreeing(float(np.sqrt(np.nanmax(gain[np.isin(rows, best_rows)]))), best_rows)
        )
        self.tested = self._adjusted(use, {}, best_rows, factor)
        self.kept[best_rows] = True
        names = [labels(o, part) for o, part in zip(self.records.observed, self.records.split(self.kept)) if part.any()]
        text = f"{self.records.observed[places[0]].kind}: one of these is wrong, and nothing tells which; "
        scaled = f", with standard deviations {factor:.3g} times as large" if factor > 1.0 else ""
        text += "by little: all of them are used" if ambiguous else STAY.format(how=scaled)
        self.notes.append(Note("warning", text, tuple(name for kind_names in names for name in kind_names)))

    def _at_points_of(self, rows: list[int]) -> Bool:
        """Some records, and those at their points: a ray that went with its control point is no witness against it."""
        points = self.records.point[rows]
        records_at = self.records.native & self.records.at_points & np.isin(self.records.point, points[points >= 0])
        records_at[rows] = True
        return np.asarray(records_at)

    def _without(self, use_without: Bool, with_record: TestedBlock, best_rows: Int) -> TestedBlock | None:
        """Adjusted without some records; None where that leaves open what only they determine."""
        try:
            reduced = self._adjusted(use_without, {})
        except (GeometryError, ConvergenceError):
            return None
        count = sum(
            int(
                o.records.observed_components()[
                    best_rows[(best_rows >= p.start) & (best_rows < p.stop)] - p.start
                ].sum()
            )
            for o, p in zip(self.records.observed, self.records.parts)
        )
        redundancy_lost = with_record.result.adjusted.redundancy - count - reduced.result.adjusted.redundancy
        return (
            reduced
            if redundancy_lost >= 0 and reduced.result.point_adjusted.sum() >= with_record.result.point_adjusted.sum()
            else None
        )

    def _agreeing(self, test: float, rows: Int) -> float:
        """Factor of standard deviations by which records agree, by their test; 1 where one is exact."""
        parts = zip(self.records.observed, self.records.parts)
        exact = any(o.holds is not None and ((rows >= p.start) & (rows < p.stop)).any() for o, p in parts)
        return 1.0 if exact else max(test, 1.0)

    def _adjusted(self, use: Bool, soft: dict[int, float], rows: Int = NONE, factor: float = 1.0) -> TestedBlock:
        """Adjusted anew; `soft` are sigmas of exact coordinates by place, `factor` that of the sigmas of rows."""
        block: BundleInput = from_result(self.tested.block, self.tested.result)
        observed = list(self.records.without(block.observed, use))
        for place, part in enumerate(self.records.parts) if len(rows) else ():
            inside = np.isin(np.arange(part.start, part.stop), rows)
            if inside.any():
                number = np.where(inside[:, None], 0, np.full((1, observed[place].records.rows), -1))
                observed[place] = with_factor(observed[place], number, np.array([factor]))
        for place, sigma in soft.items():
            observed[place] = softened(observed[place], sigma)
        block = replace(block, observed=tuple(observed))
        return replace(self.tested, block=block, result=self.adjust(block, AdjustOptions()), active=use)

    def _place(self, places: list[int], row: int) -> tuple[int, int]:
        """Place of a record's observations, and its row there."""
        place = next(p for p in places if self.records.parts[p].start <= row < self.records.parts[p].stop)
        return place, row - self.records.parts[place].start

    def _soft(self, place: int, k: int) -> float:
        """Standard deviation of exact coordinates for the trial, m; 0 where there are none, NaN where nothing tells."""
        observations = self.tested.result.observations[place]
        if self.records.observed[place].holds is None:
            return 0.0
        exact = observations.observed.again().demanded()[k]
        variance = np.diag(observations.covariance[k])[exact] * NEARLY_EXACT**2
        if not np.isfinite(variance).all():  # its point is lost with it: as good as the others that are not exact
            others = np.diagonal(self.tested.result.point_covariance_m2, axis1=1, axis2=2)
            others = others[(others > 0).all(axis=1)]
            variance = np.median(others, axis=0) if len(others) else np.full(3, np.nan)
        return SOFT_IN_TRIAL * float(np.sqrt(variance.min(initial=np.inf))) if exact.any() else 0.0


def _gains(tested: TestedBlock, place: int, records: AllRecords) -> Float:
    """Gains of leaving out each of the observations in use, NaN for the others, (n,)."""
    observations = tested.result.observations[place]
    gain = np.full(len(observations.observed), np.nan)
    rows = np.flatnonzero(observations.used & records.split(records.native)[place])
    gain[rows] = gains_of(observations, tested.result.adjusted.state, rows)
    return gain
