"""Adjust a problem in parts: each with its own observations, all through the same iterations.

A part eliminates its ground points and inner unknowns; what that leaves for the unknowns it shares goes up, their
solution comes down. Values of points and inner unknowns stay where they are until the end, and so does the factor; the
covariances that follow from it come with the result. What only the whole shows (an unknown that is not determined, an
iteration that does not converge) ends the parts, and the whole is adjusted at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.covariance.marginal import Covariances, covariances_at
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.iterative.forecast import fits_in_memory
from aatri.adjustment.others import NotInParts
from aatri.adjustment.parts.cut import Part, Vetoes, VetoOf, cut, records_of, veto_of
from aatri.adjustment.parts.top import Failed, OthersByMessages, Top
from aatri.adjustment.problem import Problem, SolverSettings
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import Curve, adjust_large
from aatri.adjustment.stepping.adjusted import Adjusted, Step
from aatri.adjustment.stepping.kept_iterations import arrays_of, state_of
from aatri.adjustment.structure.index_problem import indexed
from aatri.adjustment.structure.indexed_problem import IndexedProblem, counts
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Float
from aatri.errors import AatriError
from aatri.notes import Note
from aatri.progress import NO_CHECKPOINT, SILENT, Reporter
from aatri.together import Threads


@dataclass(frozen=True)
class AdjustedInParts(Adjusted):
    """A converged adjustment of which no process has the whole factor."""

    covariances: Covariances | None = None

    @property
    def has_factor(self) -> bool:
        """No: each part had its own."""
        return False


@dataclass(frozen=True)
class PartTask:
    """What a worker gets."""

    part: Part
    records: tuple[Records, ...]
    veto: Vetoes | None
    start: State
    settings: SolverSettings
    covariances: bool


class _Tasks(Sequence[PartTask]):
    """The tasks of all parts. Each is made when it is taken: it has a copy of its observations."""

    def __init__(self, parts: Sequence[Part], made: Callable[[Part], PartTask]) -> None:
        self._parts, self._made = parts, made

    def __len__(self) -> int:
        return len(self._parts)

    def __getitem__(self, k: Any) -> Any:
        return self._made(self._parts[k])


@dataclass(frozen=True)
class PartAdjusted:
    """What a worker gives."""

    values: dict[str, Any]
    """By array of the state: the blocks that are the part's own."""
    history: tuple[Step, ...]
    cost: float
    down_weighted: int
    notes: tuple[Note, ...]
    groups: dict[str, Float]
    records: tuple[Float, ...]
    """Covariances of its own blocks by group, and of its records; none where they were not asked for."""


def adjust(
    unknowns: Sequence[Unknowns],
    records: Sequence[Records],
    start: State,
    *,
    constraints: Sequence[Records] = (),
    settings: SolverSettings,
    vetoes: Sequence[VetoOf | None],
    curve: Curve | None = None,
    covariances: bool = False,
    reporter: Reporter = SILENT,
) -> Adjusted:
    """Adjust a problem, in parts where the settings say so.

    Parameters
    ----------
    unknowns, records, start, constraints, settings, reporter
        As in `adjust_large`.
    vetoes : sequence of callables
        Of each of the records, or None.
    curve : callable, optional
        As in `adjust_large`; parts go without.
    covariances : bool
        Whether those of all unknowns are wanted of what is adjusted in parts: there is no factor of it afterwards.

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge.
    """
    if settings.parts > 1:
        reason = "exact constraints join all of it"
        if not constraints:
            stated = Problem(tuple(unknowns), tuple(records))
            adjusted = _in_parts(stated, start, settings, vetoes, covariances, reporter)
            if isinstance(adjusted, Adjusted):
                return adjusted
            reason = adjusted
        reporter.log(f"adjusted as a whole: {reason}")
    of_all = [veto(np.flatnonzero(r.active)) for veto, r in zip(vetoes, records) if veto]
    veto = Vetoes(tuple(of_all)) if of_all else None
    settings = replace(settings, parts=1)
    return adjust_large(
        unknowns, records, start, constraints=constraints, settings=settings, veto=veto, curve=curve, reporter=reporter
    )


def _undivided(settings: SolverSettings) -> SolverSettings:
    """Settings of the index of the whole, from which the parts are cut."""
    return replace(settings, ordering="nested_dissection" if settings.ordering == "auto" else settings.ordering)


def _in_parts(
    stated: Problem,
    start: State,
    settings: SolverSettings,
    vetoes: Sequence[VetoOf | None],
    covariances: bool,
    reporter: Reporter,
) -> Adjusted | str:
    """The adjusted problem, or why it must be adjusted as a whole.

    Where the whole has no room, its index is not kept beside a part either, but made again in the end.
    """
    problem = indexed(stated, _undivided(settings))
    parts, all_records = cut(problem, settings.parts), problem.records
    if len(parts) < 2:
        return "it is too small for parts"
    observations, n_unknowns, redundancy = counts(problem)
    top = Top(redundancy, reporter)
    threads = settings.threads if settings.workers else max(1, problem.threads // len(parts))
    own = replace(settings, parts=1, workers=None, checkpoint=NO_CHECKPOINT, solver="direct", threads=threads)

    def task(part: Part) -> PartTask:
        veto = veto_of(vetoes, all_records, part)
        return PartTask(part, records_of(all_records, part), veto, start, own, covariances)

    index = problem if fits_in_memory(problem) else None
    del problem
    results = (settings.workers or Threads()).together(adjust_part, _Tasks(parts, task), top.answers)
    failed = next((r.reason for r in results if isinstance(r, Failed)), "")
    if failed:
        return failed
    problem = index or indexed(stated, _undivided(settings))
    state = dict(start)
    for part, result in zip(parts, results):
        state = _with_values(state, part, result)
    first: PartAdjusted = results[0]
    weighted = first.down_weighted
    sigma0 = float(np.sqrt(first.cost / redundancy)) if redundancy > 0 and not weighted else float("nan")
    covariances_of_parts = _covariances(problem, parts, results) if covariances and not weighted else None
    return AdjustedInParts(
        state,
        problem,
        first.cost,
        observations,
        n_unknowns,
        redundancy,
        sigma0,
        first.history,
        weighted,
        notes=_notes(results),
        covariances=covariances_of_parts,
    )


def adjust_part(work: PartTask, exchange: Callable[[Any], Any]) -> PartAdjusted | Failed:
    """On a worker: adjust a part."""
    others, part = OthersByMessages(exchange), work.part
    try:
        settings = replace(work.settings, others=others)
        adjusted = adjust_large(part.unknowns, work.records, work.start, settings=settings, veto=work.veto)
        covariances = None
        if work.covariances and not adjusted.down_weighted:
            factored = factorise(adjusted.problem, adjusted.state)
            covariances = covariances_at(adjusted.problem, adjusted.state, factored, release=True)
    except (NotInParts, AatriError, MemoryError) as problem:
        failed = Failed(str(problem) or "no memory")
        if not isinstance(problem, NotInParts):
            exchange(failed)
        return failed
    values = {
        name: {key: value[part.own[name]] for key, value in arrays_of({name: adjusted.state[name]}).items()}
        for name in part.own
    }
    groups = {} if covariances is None else {name: covariances.groups[name][own] for name, own in part.own.items()}
    return PartAdjusted(
        values,
        adjusted.history,
        adjusted.cost,
        adjusted.down_weighted,
        adjusted.notes,
        groups,
        () if covariances is None else covariances.records,
    )


def _with_values(state: dict[str, Any], part: Part, result: PartAdjusted) -> dict[str, Any]:
    """The state with the values of a part's own blocks."""
    arrays = arrays_of(state)
    for name, own in part.own.items():
        for key, values in result.values[name].items():
            arrays[key] = arrays[key].copy()
            arrays[key][own] = values
    return state_of(state, arrays)


def _covariances(problem: IndexedProblem, parts: Sequence[Part], results: Sequence[PartAdjusted]) -> Covariances:
    """The covariances of all parts as those of the whole; zero for what is held."""
    groups = {u.name: np.zeros((len(u.free), u.size, u.size)) for u in problem.unknowns}
    records = tuple(np.full((len(r.active), r.rows, r.rows), np.nan) for r in problem.records)
    for part, result in zip(parts, results):
        for name, own in part.own.items():
            groups[name][own] = result.groups[name]
        for of_all, rows, values in zip(records, part.rows, result.records):
            of_all[rows] = values
    rays = problem.rays
    place = -1 if rays is None else next(k for k, r in enumerate(problem.records) if r is rays.records)
    return Covariances(groups, np.zeros((0, 0, 0)) if rays is None else records[place], records)


def _notes(results: Sequence[PartAdjusted]) -> tuple[Note, ...]:
    """Notes of all parts, those of one text as one."""
    notes: dict[tuple[str, str], tuple[Note, tuple[str, ...]]] = {}
    for note in (note for result in results for note in result.notes):
        first, ids = notes.get((note.level, note.text), (note, ()))
        notes[note.level, note.text] = first, (*ids, *note.ids)
    return tuple(replace(first, ids=ids) for first, ids in notes.values())
