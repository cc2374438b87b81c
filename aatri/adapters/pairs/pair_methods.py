"""Relative orientation of all pairs by one of the classical methods: what the variants of the role share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aatri.adapters.pairs.image_pairs import Pairs, models_of, pairs_of
from aatri.adapters.pairs.orientation_points import named_points, oriented_by
from aatri.adapters.pairs.pair_notes import notes_of_pairs, refuse_misfits
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Elements, Models
from aatri.geometry.coplanarity import RayPairs, parallax
from aatri.geometry.intersection import intersect_pair
from aatri.notes import Note
from aatri.orientation.relative.classical_points import classical_points
from aatri.orientation.relative.elements import DEPENDENT, INDEPENDENT, dependent_elements, independent_elements
from aatri.orientation.relative.equal_weights import adjusted_with_equal_weights
from aatri.orientation.relative.image_scale import limit_of, with_sigmas
from aatri.orientation.relative.orientations import RelativeOrientations
from aatri.orientation.relative.pairs import relative_orientations
from aatri.progress import Reporter


@dataclass(frozen=True)
class PairRules:
    """How pairs are adjusted; see the options of the stages.

    Attributes
    ----------
    max_iterations : int
    snooping_limit : float or None
        None: by the number of points tested.
    min_points : int
    max_sigma0 : float
    equation : {'rigorous', 'q', 'determinant'}
    coordinates : {'intersection', 'coefficients'}
        Of the model points.
    orientation_points : Path or None
        File of the names of the points that orient; None: all.
    """

    max_iterations: int
    snooping_limit: float | None
    min_points: int
    max_sigma0: float
    equation: str = "rigorous"
    coordinates: str = "intersection"
    orientation_points: Path | None = None


def oriented_pairs(
    block: Block, image_points: ImagePoints, images: Int, frame: str, rules: PairRules, reporter: Reporter
) -> tuple[Models, tuple[Note, ...]]:
    """Models of pairs of images, with the elements of the method.

    Parameters
    ----------
    images : (m, 2) int
        Rows in images.
    frame : {'dependent', 'independent'}
        Frame in which the equations of equal weight are formed, and the elements told.
    """
    pairs, found, notes = adjusted_pairs(block, image_points, images, frame, rules, reporter)
    if rules.coordinates == "coefficients":
        for pair in np.flatnonzero(found.formed):
            mine = np.arange(pairs.start[pair], pairs.start[pair + 1])
            found.xyz[mine] = classical_points(found.left_from_right[pair], found.base[pair], pairs.rays.take(mine))
    models = models_of(block, image_points, pairs, found)
    reporter.progress(len(pairs.left), len(pairs.left), "models")
    return with_elements(models, frame), (*notes, *notes_of_pairs(block, image_points, pairs, found, models))


def adjusted_pairs(
    block: Block, image_points: ImagePoints, images: Int, frame: str, rules: PairRules, reporter: Reporter
) -> tuple[Pairs, RelativeOrientations, tuple[Note, ...]]:
    """The pairs, their rays with the standard deviations used, and their orientations by the equation asked for."""
    pairs = pairs_of(block, image_points, images)

    def orient(rays: RayPairs, start: Int) -> RelativeOrientations:
        return relative_orientations(
            rays, start, snooping_limit=rules.snooping_limit, max_iterations=rules.max_iterations,
            min_points=rules.min_points, reporter=reporter,
        )  # fmt: skip

    named = np.ones(len(block.points), dtype=bool)
    if rules.orientation_points is None:
        found = orient(pairs.rays, pairs.start)
    else:
        named = named_points(rules.orientation_points, block.points.id)
        found = oriented_by(pairs, named, limit_of(pairs.rays, rules.snooping_limit), orient)
    pairs = replace(pairs, rays=with_sigmas(pairs.rays, found.scale))
    notes: tuple[Note, ...] = ()
    if rules.equation != "rigorous" and found.formed.any():
        _with_equal_weights(pairs, found, rules.equation, frame, named[pairs.point])
        text = (
            f"orientations by equal weights of the equation {rules.equation}; points were rejected by the rigorous one"
        )
        notes = (Note("note", text),)
    refuse_misfits(found, rules.max_sigma0)
    return pairs, found, notes


def with_elements(models: Models, frame: str) -> Models:
    """The models with the elements of a method."""
    o = models.orientations
    of = independent_elements if frame == "independent" else dependent_elements
    names = INDEPENDENT if frame == "independent" else DEPENDENT
    values, sigma = of(o.left_from_right, o.base, o.covariance)
    return replace(models, elements=elements_table(np.arange(len(o)), names, values, sigma))


def elements_table(model: Int, names: tuple[str, ...], values: Float, sigma: Float) -> Elements:
    """Elements of models, (m, k) values and sigmas."""
    return Elements(
        model=np.repeat(model, len(names)).astype(np.int32),
        name=np.tile(np.array(names, dtype=np.str_), len(model)),
        value=values.ravel(),
        sigma=sigma.ravel(),
    )


def _with_equal_weights(pairs: Pairs, found: RelativeOrientations, equation: str, frame: str, orients: Bool) -> None:
    """Put the orientations of the classical equation, by the points that orient, in the place of the rigorous ones."""
    formed = np.flatnonzero(found.formed)
    of_row = np.repeat(np.arange(len(pairs.left)), np.diff(pairs.start))
    rows = np.flatnonzero(found.active & orients & found.formed[of_row])
    place = np.searchsorted(formed, of_row[rows])
    R, base, covariance, sigma0, iterations = adjusted_with_equal_weights(
        equation, frame, found.left_from_right[formed], found.base[formed], pairs.rays.take(rows), place
    )
    for k, pair in enumerate(formed.tolist()):
        if not iterations[k]:
            found.formed[pair] = False
            found.reasons[pair] = f"the equation {equation} with equal weights does not converge"
            continue
        found.left_from_right[pair], found.base[pair] = R[k], base[k]
        found.covariance[pair], found.sigma0[pair] = covariance[k], sigma0[k]
        found.iterations[pair] += iterations[k]
        refresh_points(pairs, found, pair)


def refresh_points(pairs: Pairs, found: RelativeOrientations, pair: int) -> None:
    """Model points and y-parallaxes of a pair whose orientation has changed."""
    mine = slice(int(pairs.start[pair]), int(pairs.start[pair + 1]))
    rays = pairs.rays.take(np.arange(mine.start, mine.stop))
    points = intersect_pair(found.left_from_right[pair], found.base[pair], rays)
    found.xyz[mine], found.point_covariance[mine], found.depth[mine] = points.xyz, points.covariance, points.depth
    found.parallax_mm[mine] = parallax(found.left_from_right[pair], found.base[pair], rays)[0]
    found.active[mine] &= (points.depth > 0).all(axis=1)
