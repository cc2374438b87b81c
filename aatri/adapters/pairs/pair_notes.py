"""What is to be said of the relative orientations of many pairs, and which of them their sigma0 refuses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adapters.pairs.image_pairs import doubtful_sequences, pair_names
from aatri.adjustment.statistics.global_test import pooled_test, refuse_misfit, sigma0_note, single_misfits
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.notes import Note
from aatri.orientation.relative.image_pairs import ImagePairs
from aatri.orientation.relative.orientations import RelativeOrientations


def refuse_misfits(orientations: RelativeOrientations, max_sigma0: float) -> None:
    """Pairs whose sigma0 is beyond the limit make no model; where all together are, there is no result.

    Raises
    ------
    ConvergenceError
        If the pooled sigma0 is beyond the limit.
    """
    formed = np.flatnonzero(orientations.formed)
    what = f"of {len(formed)} models together"
    refuse_misfit(pooled_test(orientations.sigma0[formed], orientations.redundancy[formed]), max_sigma0, what)
    for pair in formed[np.nan_to_num(orientations.sigma0[formed]) > max_sigma0].tolist():
        orientations.formed[pair] = False
        orientations.reasons[pair] = f"sigma0 {orientations.sigma0[pair]:.1f}, beyond max_sigma0 = {max_sigma0:g}"


def notes_of_pairs(
    block: Block, image_points: ImagePoints, pairs: ImagePairs, orientations: RelativeOrientations, models: Models
) -> tuple[Note, ...]:
    """Doubtful places in the strips, pairs without model, warnings of models, sigma0, counts."""
    of_models = (*_of_models(models, orientations.scale), *_of_axes(models))
    return (*_doubtful(block, image_points), *_of_pairs(block, pairs, orientations), *of_models)


def _doubtful(block: Block, image_points: ImagePoints) -> Iterator[Note]:
    for image, other in doubtful_sequences(block, image_points):
        first, second = block.images.id[[image, other]]
        yield Note(
            "warning",
            f"image {first} shares more points with {second} than with its neighbours: is the strip's sequence right?",
        )


def _of_pairs(block: Block, pairs: ImagePairs, orientations: RelativeOrientations) -> Iterator[Note]:
    names = pair_names(block, pairs)
    for pair in sorted(orientations.reasons.keys() | orientations.warnings.keys()):
        if pair in orientations.reasons:
            yield Note("warning", f"no model {names[pair]}: {orientations.reasons[pair]}")
        for text in orientations.warnings.get(pair, ()):
            yield Note("warning", f"model {names[pair]}: {text}")


def _of_axes(models: Models) -> Iterator[Note]:
    """Models whose elements of the dependent method are told in turned axes."""
    base = models.orientations.base
    across = int((np.abs(base[:, 1]) > np.abs(base[:, 0])).sum())
    if across and models.elements is not None and "by/bx" in models.elements.name:
        text = f"the base of {across} of {len(base)} models runs along y of the left image: their elements "
        yield Note("note", text + "phi2 ... bz/bx have their axes turned by a quarter, X along the flight")


def _of_models(models: Models, scale: float) -> Iterator[Note]:
    o = models.orientations
    if len(o):
        yield sigma0_note(pooled_test(o.sigma0, o.redundancy), f"of {len(o)} models")
    if scale > 1.0:
        text = f"tests and covariances with {scale:.2f} times the standard deviations of the image points, as the "
        yield Note("note", text + "y-parallaxes of all points ask for before any is rejected")
    off = single_misfits(o.sigma0 / scale, o.redundancy)
    if off.any():
        told = tuple(f"{name} ({s:.2f})" for name, s in zip(o.id[off], o.sigma0[off]))
        yield Note("warning", "sigma0 of single models is too large", told)
    rejected = int(np.sum(~models.model_points.active))
    yield Note("note", f"{len(o)} models, {len(models.unformed)} pairs without; {rejected} model points rejected")
