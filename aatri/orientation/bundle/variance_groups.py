"""Variance components of a bundle: the standard deviations of groups of observations, from their own residuals.

The block is adjusted, each group gets the factor sqrt(v'P v / r) on its standard deviations, and the block is adjusted
with them, until no factor moves by more than `SAME`. A group that fits without residuals (made-up observations) keeps
its standard deviation. See `adjustment.statistics.variance_components`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.adjusted_observations import sigmas_of_groups
from aatri.adjustment.statistics.variance_components import GroupSigmas
from aatri.arrays import Float, Int
from aatri.errors import ConvergenceError, ResourceError
from aatri.notes import Note
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.limits import RUNAWAY_FACTOR
from aatri.orientation.bundle.result import Adjust, BundleResult, from_result

SAME = 0.003
"""Relative change of a standard deviation below which it is found."""

ROUNDS = 25


@dataclass(frozen=True)
class VarianceGroups:
    """Groups of observations that have a standard deviation in common."""

    names: tuple[str, ...]
    number: tuple[Int, ...]
    """Tuple of (n, m). Of every component of each of the observations of a block; -1 none."""


def variance_components(
    inputs: BundleInput, result: BundleResult, adjust: Adjust, groups: VarianceGroups
) -> tuple[GroupSigmas, BundleInput, BundleResult]:
    """Estimate the standard deviations of groups.

    Parameters
    ----------
    result : BundleResult
        Of it, with covariances.

    Returns
    -------
    GroupSigmas
        With the new standard deviations; factors are on those given.
    BundleInput, BundleResult
        The block with the new standard deviations, and adjusted with them.

    Raises
    ------
    ResourceError
        If there are no standard deviations to begin with.
    ConvergenceError
        If the factors do not settle.
    """
    if not result.adjusted.has_factor:
        raise ResourceError(
            "variance_components needs standard deviations, and conjugate gradients give none",
            remedy="raise memory_gb, or leave out variance_components",
        )
    n = len(groups.names)
    initial = sigmas_of_groups(result.observations, result.adjusted.state, groups.number, n)
    factor, frozen = np.ones(n), initial.factor < 1 / RUNAWAY_FACTOR  # these have no residuals
    rescaled, adjusted = inputs, result
    for _ in range(ROUNDS):
        sigmas = sigmas_of_groups(adjusted.observations, adjusted.adjusted.state, groups.number, n)
        frozen |= ~sigmas.estimable
        change = np.where(frozen, 1.0, sigmas.factor)
        factor = np.where(frozen, 1.0, factor)
        if np.abs(change - 1).max(initial=0.0) < SAME:
            return replace(sigmas, factor=factor, estimable=~frozen), rescaled, adjusted
        factor = factor * change
        if (factor > RUNAWAY_FACTOR).any() or (factor < 1 / RUNAWAY_FACTOR).any():
            break
        observed = tuple(with_factor(o, number, factor) for o, number in zip(inputs.observed, groups.number))
        rescaled = from_result(replace(inputs, observed=observed), adjusted)
        adjusted = adjust(rescaled)
    names = ", ".join(f"{name} {f:.3g}" for name, f in zip(groups.names, factor))
    raise ConvergenceError(
        f"the standard deviations of the groups do not settle in {ROUNDS} adjustments (factors {names}): they cannot "
        "be told from each other",
        remedy="fewer groups in variance_components, or leave it out",
    )


def variance_notes(names: Sequence[str], sigmas: GroupSigmas, *, applied: bool) -> list[Note]:
    """What the components say; a warning where given standard deviations do not fit."""
    low, high = sigmas.limits
    texts = [
        f"{names[g]}: {sigmas.factor[g]:.3g} times ({low[g]:.3g} to {high[g]:.3g}, 95 %)"
        for g in np.flatnonzero(sigmas.differs).tolist()
    ]
    notes = []
    if texts:
        treatment = "applied" if applied else "proposed, not applied: set them in the block, or `apply: true`"
        notes.append(Note("warning", f"standard deviations from the residuals, {treatment}", tuple(texts)))
    not_estimable = [names[g] for g in np.flatnonzero(~sigmas.estimable).tolist()]
    if not_estimable:
        notes.append(
            Note(
                "note",
                "standard deviation not estimable (redundancy below 10, or no residuals), as given",
                tuple(not_estimable),
            )
        )
    if not texts:
        notes.append(Note("note", "variance components: the given standard deviations fit the residuals"))
    return notes


def with_factor(o: Observed, number: Int, factor: Float) -> Observed:
    """Standard deviations times the factor of each component's group; correlations stay."""
    if o.exact:
        return o
    inverse = np.where(number >= 0, 1.0 / np.append(factor, 1.0)[number], 1.0)
    unreduced = None if o.unreduced is None else with_factor(o.unreduced, number, factor)
    L = o.records.whitener
    scaled = L * inverse if L.ndim == 2 else L * inverse[:, None, :]
    return replace(o, records=replace(o.records, whitener=scaled), unreduced=unreduced)


def grouped(observed: Sequence[Observed], labels: Sequence[Sequence[str]], parts: Sequence[Int]) -> VarianceGroups:
    """Groups from labels: of each of the observations the labels it has, and which one each component has.

    Parameters
    ----------
    parts : sequence of (n, m) int
        Place among the labels; -1 none.
    """
    names = sorted({label for kind_labels in labels for label in kind_labels})
    place = {name: k for k, name in enumerate(names)}
    number = []
    for kind_labels, part in zip(labels, parts):
        group_of_label = np.array([place[label] for label in kind_labels] + [-1], dtype=np.int64)
        number.append(group_of_label[part])
    used = np.zeros(len(names), dtype=bool)
    for o, n in zip(observed, number):
        used[np.unique(n[o.records.observed_components() & (n >= 0)])] = True
    renumber = np.append(np.where(used, np.cumsum(used) - 1, -1), -1)
    used_names = tuple(name for name, u in zip(names, used) if u)
    return VarianceGroups(used_names, tuple(renumber[n] for n in number))
