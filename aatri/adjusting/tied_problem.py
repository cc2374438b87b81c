"""Bodies tied by common points and by what is observed of the ground: what is adjusted, with its index and weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjusting.added_variance import observed_components, tie_whitener, typical_variance, whitener_beside
from aatri.adjustment.covariance.dense import is_small
from aatri.adjustment.records import Records, keys_of
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.weights import Weights, with_weights
from aatri.adjustment.unknowns import Ids, State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text
from aatri.observations.observed import Observed, Spread, full_whitener
from aatri.observations.poses import POINT, POSE, pose_unknowns
from aatri.observations.ties import BODY

if TYPE_CHECKING:
    from aatri.artifacts.suspects import Suspects


MOST_NAMED = 3
"""Coordinates in a message."""


@dataclass(frozen=True)
class TiedProblem:
    """Ties and what is observed of the ground, with their unknowns."""

    ties: tuple[Observed, ...]
    ground: tuple[Observed, ...]
    """Of ground points, of images, and of the bodies themselves."""
    priors: tuple[Observed, ...]
    """Of the bodies' unknowns: they are not tested."""
    unknowns: tuple[Unknowns, ...]
    start: State
    what: str
    """For messages."""

    @property
    def observed(self) -> tuple[Observed, ...]:
        """All that is tested: ties, then what is observed of the ground."""
        return (*self.ties, *self.ground)

    @cached_property
    def all_records(self) -> tuple[Records, ...]:
        """Of all that is adjusted: what is tested, then the priors."""
        every = [o.records for o in (*self.observed, *self.priors)]
        return tuple(replace(r, whitener=full_whitener(r.whitener)) for r in every)

    @property
    def records(self) -> tuple[Records, ...]:
        """Of what is tested."""
        return self.all_records[: len(self.observed)]

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Names of the same, each once."""
        return keys_of(self.all_records)[: len(self.observed)]

    @cached_property
    def is_small(self) -> bool:
        """Whether whole matrices are the quicker way to adjust it."""
        return is_small(self.unknowns, self.all_records)

    @cached_property
    def index(self) -> IndexedProblem:
        """What a factorisation by fronts needs."""
        return prepare(self.unknowns, self.all_records)

    @cached_property
    def edges(self) -> list[int]:
        """Where the kinds begin among all observations, and where the last one ends."""
        return [0, *np.cumsum([len(o) for o in self.observed]).tolist()]

    @property
    def n_ties(self) -> int:
        """How many of the observations are ties: the first ones."""
        return sum(len(o) for o in self.ties)

    @cached_property
    def components(self) -> Bool:
        """Components of all observations that are observed, (n, 3)."""
        return in_three([observed_components(o).astype(float) for o in self.observed]) > 0

    @cached_property
    def covariances(self) -> tuple[Float, ...]:
        """Of what is observed of the ground, kind by kind, a priori."""
        return tuple(o.covariances() for o in self.ground)

    @cached_property
    def ground_variance(self) -> Float:
        """Traces of these."""
        return np.concatenate([np.zeros(0), *(np.einsum("nii->n", C) for C in self.covariances)])

    def spread(self, state: State) -> Spread:
        """Covariances of all ties at a state, tau not counted."""
        parts = [o.spread.at(state) for o in self.ties if o.spread is not None]
        if len(parts) == 1:
            return parts[0]
        values, vectors = (np.concatenate(columns) for columns in zip(*((p.values, p.vectors) for p in parts)))
        return Spread(values, vectors, self.spread)

    def whiteners(self, spread: Spread, tau_m: float) -> tuple[Float, ...]:
        """Of all observations, kind by kind."""
        typical = typical_variance(spread, tau_m) if self.ground else 1.0
        ties = np.split(tie_whitener(spread, tau_m), self.edges[1 : len(self.ties)])
        return (*ties, *(whitener_beside(o, C, typical) for o, C in zip(self.ground, self.covariances)))

    def weights(self, use: Bool, whiteners: Sequence[Float]) -> dict[str, Weights]:
        """Weights of all observations, of which some are in use."""
        parts = np.split(use, self.edges[1:-1])
        return {key: Weights(active, T) for key, active, T in zip(self.keys, parts, whiteners)}

    def weighted(self, state: State, use: Bool) -> IndexedProblem:
        """The problem with the weights of a state, tau not counted, and some active observations."""
        weights = self.weights(use & self.taking_part(use), self.whiteners(self.spread(state), 0.0))
        return with_weights(self.index, weights)

    def taking_part(self, use: Bool) -> Bool:
        """Observations whose points and images, if they have any, some active tie holds, (n,)."""
        tied = {POINT: np.zeros(len(self.start[POINT]), dtype=bool)}
        tied |= {POSE: np.zeros(len(self.start[POSE].position_m), dtype=bool)} if POSE in self.start else {}
        for o, first in zip(self.ties, self.edges):
            for group, block in o.records.touches:
                if group in tied:
                    tied[group][block[use[first : first + len(o)]]] = True
        usable = []
        for o in self.observed:
            touched = [tied[group][block] for group, block in o.records.touches if group in tied]
            usable.append(np.logical_and.reduce([np.ones(len(o), dtype=bool), *touched]))
        return np.concatenate(usable)

    def farthest_off(self, state: State) -> str:
        """The points and images that a state misses most, for messages; empty where it misses none."""
        missed: dict[str, float] = {}
        for o in (o for o in self.observed if is_coordinates(o) or o.spread is not None):
            rows = np.arange(len(o))
            v = np.where(observed_components(o), np.nan_to_num(o.records.evaluate(state, rows)[0]), 0.0)
            for off_m, image, point in zip(np.linalg.norm(v, axis=1).tolist(), *o.names(rows)):
                name = f"point {point}" if point else f"image {image}"
                missed[name] = max(missed.get(name, 0.0), off_m)
        worst = sorted((name for name in missed if missed[name] > 0), key=lambda name: -missed[name])[:MOST_NAMED]
        return f"; farthest off: {', '.join(f'{name} {missed[name]:.2g} m' for name in worst)}" if worst else ""


def tied_problem(observed: Sequence[Observed], start: State, ids: Mapping[str, Ids], what: str) -> TiedProblem:
    """State and index a problem.

    Parameters
    ----------
    observed : sequence of Observed
        Ties, what is observed of the ground, priors of the bodies.
    start : mapping
        Points, and poses where ties or others touch images; their rotations are unknown where priors touch them.
    ids : mapping
        Ids of points and images.
    what : str
        For messages.
    """
    ties = tuple(o for o in observed if o.spread is not None)
    priors = tuple(o for o in observed if o.spread is None and o.components)
    ground = tuple(o for o in observed if o.spread is None and not o.components)
    touched: dict[str, list[Int]] = {POINT: [], POSE: []}
    for o in ties:
        for group, block in o.records.touches:
            if group != BODY:
                touched[group].append(block)
    own = {u.name: u for o in observed for u in o.unknowns}
    values = {name: value for o in observed for name, value in o.start.items()}
    unknowns = list(own.values())
    if touched[POSE]:
        place = start[POSE].position_m
        free = np.zeros((len(place), 6), dtype=bool)
        free[np.concatenate(touched[POSE]), :3] = True
        for block in (block for o in priors for group, block in o.records.touches if group == POSE):
            free[block] = True
        unknowns.append(pose_unknowns(ids[POSE], free, place))
    tied = np.zeros((len(start[POINT]), 3), dtype=bool)
    tied[np.concatenate([np.zeros(0, dtype=np.int32), *touched[POINT]])] = True
    unknowns.append(Unknowns(POINT, tied, ("X", "Y", "Z"), ids[POINT], add_step, eliminated=True))
    return TiedProblem(ties, ground, priors, tuple(unknowns), {**start, **values}, what)


def is_coordinates(o: Observed) -> bool:
    """Whether these are given coordinates: of points, or of projection centres."""
    return o.unit == "m" and o.records.rows == 3


def in_three(parts: Sequence[Float]) -> Float:
    """Columns (n,), residuals (n, k) or matrices (n, k, k) of all observations, k filled up to three with zeros."""
    filled = []
    for part in parts:
        lacking = 0 if part.ndim == 1 else 3 - part.shape[-1]
        filled.append(np.pad(part, [(0, 0), *[(0, lacking)] * (part.ndim - 1)]) if lacking else part)
    return np.concatenate(filled)


def named_by_suspects(suspects: Suspects, kind: str, image: Text, point: Text) -> Bool:
    """Observations of a kind, (n,), that suspects which stay out name by the ids of image (or body) and point."""
    out = suspects.take(np.flatnonzero((suspects.kind == kind) & suspects.staying_out))
    names = set(zip(out.image.tolist(), out.point.tolist()))
    return np.array([pair in names for pair in zip(image.tolist(), point.tolist())], dtype=bool)


def not_rejected(observed: Sequence[Observed], before: Mapping[str, Suspects]) -> Bool:
    """Which observations no earlier stage has rejected, (n,), kind by kind.

    Parameters
    ----------
    before : mapping
        Suspects of earlier stages, by kind. What has no row in the Block is known by its names.
    """
    parts = [~_rejected(o, before[o.kind]) if o.kind in before else np.ones(len(o), dtype=bool) for o in observed]
    return np.concatenate([np.zeros(0, dtype=bool), *parts])


def _rejected(o: Observed, before: Suspects) -> Bool:
    if not len(before):
        return np.zeros(len(o), dtype=bool)
    out = (before.kind == o.kind) & before.staying_out
    if not out.any() or (o.row >= 0).any():
        return np.asarray(np.isin(o.row, before.row[out & (before.row >= 0)]))
    return named_by_suspects(before, o.kind, *o.names(np.arange(len(o))))
