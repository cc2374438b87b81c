"""Unknowns that observations share beside those they are about: shift and drift of positions or attitudes, and others.

    v = v_0 + s + (t - t_mean) d + ...,      dv/ds = I,   dv/dd = (t - t_mean) I

s is the shift and d the drift per unit of time that the observations of a group share, both free along the coordinates
that its observations give; t is the time of exposure in seconds, where a group has none the sequence of its images;
t_mean the mean over the group. A group whose images have one time has no drift. Differences of the positions of a
group, with their correlations, say the same as the positions with a free shift: `drift: shift`.

Source: Ackermann 1984, Friess 1986; docs/formulas.md 5.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text
from aatri.notes import Note
from aatri.observations.observed import Observed, named

if TYPE_CHECKING:
    from aatri.artifacts.block import Images

DRIFT = "drift"
XYZ = ("X", "Y", "Z")


@dataclass(frozen=True)
class SharedUnknowns:
    """Unknowns that some observations touch."""

    unknowns: Unknowns
    start: Float
    """(n_blocks, k)."""
    block: Int
    """(n,). Block of each observation; -1 none."""
    basis: Float | None = None
    """(n, 3, k). Derivatives; None where the observations say how they depend on it (an unknown lever arm)."""

    def take(self, rows: Int) -> SharedUnknowns:
        """Of the chosen observations."""
        return replace(self, block=self.block[rows], basis=None if self.basis is None else self.basis[rows])


def drift_term(
    group: Text,
    time: Float,
    present: Bool | None = None,
    *,
    linear: bool = True,
    name: str = DRIFT,
    labels: tuple[str, ...] = XYZ,
) -> SharedUnknowns:
    """Shift and drift of groups, along the coordinates that are `present` (n, 3); an empty name has none."""
    ids = np.unique(group[group != ""])
    block = np.where(group != "", np.searchsorted(ids, group), -1)
    basis = np.concatenate([np.broadcast_to(np.eye(3), (len(group), 3, 3)), time[:, None, None] * np.eye(3)], axis=2)
    free = _free(block, len(ids), time, np.ones((len(group), 3), bool) if present is None else present, linear=linear)
    of_both = tuple(f"{word} {label}" for word in ("shift", "drift") for label in labels)
    return SharedUnknowns(Unknowns(name, free, of_both, ids, add_step), np.zeros((len(ids), 6)), block, basis)


def _free(block: Int, n: int, time: Float, present: Bool, *, linear: bool) -> Bool:
    """Which shifts and drifts of n groups have something to be found from, (n, 6); rows of no group have block -1.

    A drift needs two times among the values of its coordinate.
    """
    free = np.zeros((n, 6), dtype=bool)
    for k in range(3):
        its = np.flatnonzero((block >= 0) & present[:, k])
        first, last = np.full(n, np.inf), np.full(n, -np.inf)
        np.minimum.at(first, block[its], time[its])
        np.maximum.at(last, block[its], time[its])
        free[:, k], free[:, 3 + k] = np.isfinite(first), linear & (last > first)
    return free


def group_times(time_s: Float, sequence: Float, group: Text) -> Float:
    """Times reduced to the mean of their group, (n,): seconds, or the sequence where a group lacks times."""
    reduced = np.zeros(len(group))
    for name in np.unique(group):
        of_group = group == name
        t = time_s[of_group] if np.isfinite(time_s[of_group]).all() else sequence[of_group]
        if np.isfinite(t).all():
            reduced[of_group] = t - t.mean()
    return reduced


def time_notes(images: Images, image: Int, group: Text) -> tuple[Note, ...]:
    """What the times of drift groups should not say: one time for all, or another order than the sequence.

    Parameters
    ----------
    images : Images
        Of the block.
    image : (n,) int
        Rows of images that belong to the groups (n,).
    """
    time, one, permuted = group_times(images.time_s[image], images.sequence[image], group), list[str](), list[str]()
    for name in np.unique(group[group != ""]).tolist():
        of_group = np.flatnonzero(group == name)
        if len(of_group) > 1 and np.ptp(time[of_group]) == 0:
            one.append(name)
        for strip in np.unique(images.strip[image[of_group]]):
            rows = of_group[(images.strip[image[of_group]] == strip) & np.isfinite(images.sequence[image[of_group]])]
            steps = np.diff(time[rows[np.argsort(images.sequence[image[rows]], kind="stable")]])
            if strip >= 0 and (steps > 0).any() and (steps < 0).any() and name not in permuted:
                permuted.append(name)
    texts = (
        (one, "drift groups whose images have one time, or no time and no sequence: a shift is estimated, no drift"),
        (permuted, "drift groups whose times do not run with the sequence of their strip: the drift goes by the times"),
    )
    return tuple(Note("warning", text, tuple(names)) for names, text in texts if names)


def with_terms(plain: Records, terms: Sequence[SharedUnknowns]) -> Records:
    """Records that touch further unknowns, linearly; those of terms without a basis they touch already."""
    linear = [(t.unknowns.name, t.block.astype(np.int32), t.basis) for t in terms if t.basis is not None]
    if not linear:
        return plain

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        v, jacobians = plain.evaluate(state, rows)
        for group, block, basis in linear:
            v = v + np.einsum("nij,nj->ni", basis[rows], state[group][block[rows]])
        return v, (*jacobians, *(basis[rows] for _, _, basis in linear))

    touches = (*plain.touches, *((group, block) for group, block, _ in linear))
    return Records(plain.name, touches, evaluate, plain.whitener, plain.active)


def observed_with_terms(
    records: Callable[[Int, bool, Sequence[SharedUnknowns]], Records],
    by_exactness: Iterable[tuple[bool, Int]],
    terms: Sequence[SharedUnknowns],
    row: Int,
    names: Text,
    unit: str,
    own: Mapping[str, tuple[Unknowns, Float]] | None = None,
) -> tuple[Observed, ...]:
    """Observations of images with their terms; those that touch the same unknowns, weighted or exact, are together.

    Parameters
    ----------
    records : callable
        (rows, exact, terms that these touch) -> their records but for the terms that have a basis.
    by_exactness : iterable of (bool, (k,) int)
        Rows with weighted components (False), and rows with exact ones (True).
    row : (n,) int
        In their table of the Block.
    names : (n,) str
        Ids of the images.
    own : mapping of str to (Unknowns, start), optional
        Further unknowns that all of them touch.
    """
    touched = np.stack([t.block >= 0 for t in terms], axis=1) if terms else np.zeros((len(row), 0), dtype=bool)
    observed_terms, new, exactness = list[Observed](), dict[str, tuple[Unknowns, Any]](own or {}), tuple(by_exactness)
    stated = set[str]()
    for pattern in np.unique(touched, axis=0) if terms else touched[:1]:
        for exact, chosen in exactness:
            alike = chosen[(touched[chosen] == pattern).all(axis=1)]
            if not len(alike):
                continue
            of_these = [t.take(alike) for t, has in zip(terms, pattern) if has]
            new |= {t.unknowns.name: (t.unknowns, t.start) for t in of_these if t.unknowns.name not in stated}
            stated |= set(new)
            observed_terms.append(
                Observed(
                    with_terms(records(alike, exact, of_these), of_these),
                    row[alike],
                    named(image=names[alike]),
                    unit,
                    exact=exact,
                    unknowns=tuple(unknowns for unknowns, _ in new.values()),
                    start={name: start for name, (_, start) in new.items()},
                )
            )
            new = {}
    return tuple(observed_terms)
