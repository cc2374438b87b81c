"""Models of pairs of images, by whatever method.

Seen: strips whose images are out of sequence, pairs without model, models that are weak or do not fit.
Test: what the method has found of a pair; sigma0 of all models pooled, and of single ones at the level 0.05 / count.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array

from aatri.adapters.pairs.image_pairs import images_of_strip, pair_names
from aatri.adjustment.statistics.global_test import pooled_test, sigma0_note, single_misfits
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.checks.after.of_stage import findings_of
from aatri.checks.finding import Finding
from aatri.checks.limits import OUT_OF_SEQUENCE
from aatri.ids import several
from aatri.orientation.relative.orientations import ImagePairs, RelativeOrientations


def findings_of_models(
    block: Block, image_points: ImagePoints, pairs: ImagePairs, orientations: RelativeOrientations, models: Models
) -> list[Finding]:
    """Doubtful places in the strips, pairs without model, warnings of models, sigma0, counts, what was rejected."""
    return [
        *_doubtful(block, image_points),
        *_of_pairs(block, pairs, orientations),
        *_of_models(models, orientations.scale),
        *_of_axes(models),
        *findings_of(block, models, "relative_orientation"),
    ]


def doubtful_sequences(block: Block, image_points: ImagePoints) -> list[tuple[int, int]]:
    """Images whose place in their strip is doubtful: they share more points with an image that is not beside them.

    Returns
    -------
    list of (image, image it shares most points with)
    """
    m = image_points.measurements
    seen = csr_array(
        (m.active.astype(np.int32), (m.image, m.point)), shape=(len(block.images), len(block.points)), dtype=np.int32
    )
    doubtful_images = []
    for strip in range(len(block.strips)):
        rows = images_of_strip(block, strip)
        part = seen[rows]
        shared = (part @ part.T).toarray()
        place = np.arange(len(rows))
        beside = np.abs(place[:, None] - place) == 1
        most_beside = np.where(beside, shared, 0).max(axis=1, initial=0)
        others = np.where(beside | np.eye(len(rows), dtype=bool), 0, shared)
        doubtful = others.max(axis=1, initial=0) > OUT_OF_SEQUENCE * most_beside
        doubtful_images += [(int(rows[k]), int(rows[others[k].argmax()])) for k in np.flatnonzero(doubtful)]
    return doubtful_images


def _doubtful(block: Block, image_points: ImagePoints) -> Iterator[Finding]:
    for image, other in doubtful_sequences(block, image_points):
        first, second = block.images.id[[image, other]]
        text = f"image {first} shares more points with {second} than with its neighbours"
        yield Finding("models", "warning", f"{text}: is the strip's sequence right?")


def _of_pairs(block: Block, pairs: ImagePairs, orientations: RelativeOrientations) -> Iterator[Finding]:
    names = pair_names(block, pairs)
    for pair in sorted(orientations.reasons.keys() | orientations.warnings.keys()):
        if pair in orientations.reasons:
            yield Finding("models", "warning", f"no model {names[pair]}: {orientations.reasons[pair]}")
        for text in orientations.warnings.get(pair, ()):
            yield Finding("models", "warning", f"model {names[pair]}: {text}")


def _of_axes(models: Models) -> Iterator[Finding]:
    """Models whose elements of the dependent method are told in turned axes."""
    base = models.orientations.base
    across = int((np.abs(base[:, 1]) > np.abs(base[:, 0])).sum())
    if across and models.elements is not None and "by/bx" in models.elements.name:
        text = f"the base of {across} of {len(base)} models runs along y of the left image: their elements "
        yield Finding("models", "note", text + "phi2 ... bz/bx have their axes turned by a quarter, X along the flight")


def _of_models(models: Models, scale: float) -> Iterator[Finding]:
    o = models.orientations
    if len(o):
        note = sigma0_note(pooled_test(o.sigma0, o.redundancy), f"of {len(o)} models")
        yield Finding("models", note.level, note.text)
    if scale > 1.0:
        text = f"tests and covariances with {scale:.2f} times the standard deviations of the image points, as the "
        yield Finding("models", "note", text + "y-parallaxes of all points ask for before any is rejected")
    off = single_misfits(o.sigma0 / scale, o.redundancy)
    if off.any():
        named = tuple(f"{name} ({s:.2f})" for name, s in zip(o.id[off], o.sigma0[off]))
        yield Finding("models", "warning", "sigma0 of single models is too large", ids=named)
    rejected = int(np.sum(~models.model_points.active))
    yield Finding(
        "models",
        "note",
        f"{several(len(o), 'model')}, {several(len(models.unformed), 'pair')} without; "
        f"{several(rejected, 'model point')} rejected",
    )
