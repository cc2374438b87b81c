"""Correlations of the unknowns that many images share: shifts, drifts, lever arms, time offsets, camera parameters.

Seen: two unknowns that stand for each other: their sum is determined, each of them is not.
Test: none; told are those of 0.90 and more, with the reason from 0.95 on (`camera.parameters.advice`). Parameters of
one camera among themselves and with the orientation are told by `parameters`.
"""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from aatri.adjustment.covariance.cross import Block, covariances_of_pairs
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Float, Int
from aatri.camera.limits import WARNED_CORRELATION
from aatri.camera.parameters.advice import advise
from aatri.checks.finding import Finding
from aatri.checks.limits import CORRELATION_LISTED, MOST_PAIRS
from aatri.ids import shown
from aatri.observations.poses import CAMERA, FILM, POINT, POSE, is_additional
from aatri.orientation.bundle.groups.candidates import MARK
from aatri.orientation.bundle.result import BundleResult


def high_correlations(result: BundleResult, kinds: Mapping[str, str]) -> list[Finding]:
    """High correlations among shared unknowns; `kinds` says what the additional parameters do."""
    if not result.adjusted.has_factor or result.adjusted.down_weighted or result.free is not None:
        return []
    shared = [u for u in result.adjusted.problem.unknowns if u.name not in (POSE, POINT, FILM) and not u.joins]
    shared = [u for u in shared if not u.name.startswith(f"{MARK} ")]  # what is left out of its frame is no parameter
    with_covariance = {name for name, c in result.covariances.items() if np.isfinite(c).any()}
    shared = [
        u
        for u in shared
        if u.name in with_covariance and np.isfinite(result.covariances[u.name][u.free.any(axis=1)]).all()
    ]
    blocks: list[Block] = [(u.name, int(k)) for u in shared for k in np.flatnonzero(u.free.any(axis=1))]
    if all(_of_camera(u.name) for u in shared) and len(blocks) < 2:
        return []
    by_name = {u.name: u for u in shared}
    correlated: list[tuple[str, str, float]] = []
    for group, k in blocks:
        if not _of_camera(group):
            own = result.covariances[group][k]
            correlated += _high(own, by_name[group], k, own, by_name[group], k, np.triu_indices(len(own), 1))
    pairs = list(combinations(blocks, 2))
    pairs.sort(key=lambda pair: pair[0][0] == pair[1][0])  # of different groups first
    first_pairs = pairs[:MOST_PAIRS]
    for (a, b), cross in zip(first_pairs, covariances_of_pairs(result.adjusted, first_pairs) if first_pairs else []):
        first, second = result.covariances[a[0]][a[1]], result.covariances[b[0]][b[1]]
        every = tuple(i.ravel() for i in np.indices(cross.shape))
        correlated += _high(cross, by_name[a[0]], a[1], first, by_name[b[0]], b[1], every, second)
    return [*_findings(correlated, kinds), *_left_out(len(pairs))]


def _of_camera(group: str) -> bool:
    return group == CAMERA or is_additional(group)


def _high(
    cross: Float,
    one: Unknowns,
    a: int,
    own: Float,
    other: Unknowns,
    b: int,
    at: tuple[Int, ...],
    second: Float | None = None,
) -> list[tuple[str, str, float]]:
    """Names and correlation of what is at `CORRELATION_LISTED` or more."""
    variance = np.outer(np.diag(own), np.diag(own if second is None else second))
    rho = np.where(variance > 0, cross / np.sqrt(np.where(variance > 0, variance, 1.0)), 0.0)
    high = [(int(i), int(j)) for i, j in zip(*at) if abs(rho[i, j]) >= CORRELATION_LISTED]
    return [
        (f"{one.labels[i]} of {one.ids[a]}", f"{other.labels[j]} of {other.ids[b]}", float(rho[i, j])) for i, j in high
    ]


def _findings(correlated: list[tuple[str, str, float]], kinds: Mapping[str, str]) -> list[Finding]:
    correlated.sort(key=lambda pair: -abs(pair[2]))
    findings = [Finding("correlations", "warning", a.text) for a in advise(correlated, kinds)[:7]]
    rest = [
        f"{a} and {b} ({rho:.3f})" for a, b, rho in correlated if abs(rho) < WARNED_CORRELATION or len(findings) >= 7
    ]
    if rest:
        text = f"correlations of {CORRELATION_LISTED:.2f} and more: {shown(rest)}"
        findings.append(Finding("correlations", "note", text))
    return findings


def _left_out(pairs: int) -> list[Finding]:
    if pairs <= MOST_PAIRS:
        return []
    text = f"correlations of {MOST_PAIRS} of {pairs} pairs of shared unknowns were looked at"
    return [Finding("correlations", "note", text)]
