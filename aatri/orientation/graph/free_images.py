"""All images of a block oriented to each other, from their pairs: components without a datum.

1. Rotations of all images from those of the pairs; pairs that do not fit are left out (`rotations`).
2. Lengths of the bases; what they do not link is another component (`scales`).
3. Projection centres, component by component (`positions`), points, rays that do not fit trimmed (`triangulation`).
4. A robust bundle, held minimally; trimmed again and adjusted once more (`component`).
5. Components with enough points in common become one (`joining`); images left over are resected to known points.

Source: Moulon, Monasse & Marlet, ICCV 2013; Pan et al., ECCV 2024; see the modules named.
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.limits import WRONG_SIGMAS
from aatri.adjustment.unknowns import Ids
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import angles_between
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.graph.component import ImageComponent, adjusted_component
from aatri.orientation.graph.joining import joined
from aatri.orientation.graph.limits import OPEN_TRIANGLES, WRONG_ROTATION_RAD
from aatri.orientation.graph.pair_graph import PairGraph, RotationPairs
from aatri.orientation.graph.positions import Start, by_directions, from_bases, from_gnss
from aatri.orientation.graph.rotations import averaged_rotations, closing_triangles
from aatri.orientation.graph.scales import scaled_bases
from aatri.progress import SILENT, Reporter


@dataclass(frozen=True)
class FreeImages:
    """Components, that of most images first, and what there is to say."""

    components: tuple[ImageComponent, ...]
    notes: tuple[Note, ...]


def orient_free(
    graph: PairGraph,
    turns: RotationPairs,
    rays: ImagePointRows,
    image_ids: Ids,
    point_ids: Ids,
    *,
    start: Start = "bases",
    observed_m: Float | None = None,
    rng: np.random.Generator | None = None,
    reporter: Reporter = SILENT,
) -> FreeImages:
    """Orient all images to each other.

    Parameters
    ----------
    turns : RotationPairs
        They help the rotations.
    image_ids, point_ids : str
    start : {'bases', 'gnss', 'random'}
        Of the projection centres.
    observed_m : (n_images, 3) float64, m, optional
        Positions, for the start by GNSS; NaN unknown.
    rng : Generator, optional
        Of the random start.

    Raises
    ------
    GeometryError
        If no component can be oriented.
    """
    n = graph.images
    rotation, error, triangles = averaged(graph, turns)
    limit = np.maximum(WRONG_ROTATION_RAD, WRONG_SIGMAS * graph.rotation_sigma_rad)
    other = np.isfinite(graph.second[:, 0, 0])
    off = angles_between(rotation[graph.left] @ graph.second, rotation[graph.right])
    wrong = (error > limit) | other & (np.where(np.isfinite(off), off, np.inf) < np.minimum(error, limit))
    undecided = other & (triangles == 0) & (angles_between(graph.left_from_right, graph.second) > limit)
    if not (wrong | undecided).all():
        wrong |= undecided
    fitting = graph.take(~wrong)
    notes = _of_pairs(graph, image_ids, error, wrong & ~other, triangles)
    if other.any():
        text = (
            f"{several(int(other.sum()), 'pair', 'is', 'are')} ambiguous, as over a plane; "
            f"{int((wrong & other).sum())} of them do not fit"
            " the others, or lie in no triangle with them, and are left out"
        )
        notes.append(Note("note", text))
    scaled = scaled_bases(fitting)
    components: list[ImageComponent] = []
    for k in range(int(scaled.component.max(initial=-1)) + 1):
        pair_rows = scaled.component == k
        pairs = fitting.take(scaled.pair[pair_rows])
        images = np.zeros(n, dtype=bool)
        images[pairs.left] = images[pairs.right] = True
        reporter.log(
            f"component {k + 1}: {several(int(images.sum()), 'image')}, "
            f"{several(int(pair_rows.sum()), 'pair', 'carries', 'carry')} its scale"
        )
        try:
            centre, centre_notes = _centres(
                pairs, scaled.length[pair_rows], rotation, rays, images, start, observed_m, rng
            )
            notes += [Note("note", text) for text in centre_notes]
            components.append(adjusted_component(rays, images, rotation, centre, image_ids, point_ids, reporter))
        except (ConvergenceError, GeometryError) as failed:
            ids = tuple(np.asarray(image_ids)[images].tolist())
            text = f"{several(len(ids), 'image', 'is', 'are')} not oriented to each other: {failed.what}"
            notes.append(Note("warning", text, ids))
    if not components:
        raise GeometryError(
            f"no pairs of the {n} images can be oriented to each other",
            remedy="measure more points common to several images; check their ids, principal distance and pixel size"
            + ("; images all taken at one place make no model" if len(turns.left) else ""),
        )
    joined_components, joining_notes = joined(components, rays, image_ids, point_ids, reporter)
    return FreeImages(tuple(joined_components), (*notes, *joining_notes))


def averaged(graph: PairGraph, turns: RotationPairs) -> tuple[Float, Float, Int]:
    """Rotations of all images, what remains of each pair in rad, and the triangles it lies in."""
    n, m = graph.images, len(graph.left)
    left, right = np.concatenate([graph.left, turns.left]), np.concatenate([graph.right, turns.right])
    pair = np.concatenate([graph.left_from_right, turns.left_from_right])
    sigma = np.concatenate([graph.rotation_sigma_rad, turns.sigma_rad])
    triangles, closing = closing_triangles(n, left, right, pair, sigma)
    share = np.where(triangles > 0, np.maximum(closing / np.maximum(triangles, 1), OPEN_TRIANGLES**2), OPEN_TRIANGLES)
    share[:m][np.isfinite(graph.second[:, 0, 0])] *= OPEN_TRIANGLES
    weight = np.sqrt(np.concatenate([graph.inliers, turns.points])) * share
    rotation, error = averaged_rotations(n, left, right, pair, weight)
    return rotation, error[:m], triangles[:m]


def _centres(
    pairs: PairGraph,
    length: Float,
    rotation: Float,
    rays: ImagePointRows,
    images: Bool,
    start: Start,
    observed_m: Float | None,
    rng: np.random.Generator | None,
) -> tuple[Float, list[str]]:
    """Projection centres of a component, and what there is to say of their start."""
    all_observed = observed_m is not None and bool(np.isfinite(observed_m[images]).all())
    if start == "random" and rng is not None:
        centre = rng.uniform(-1.0, 1.0, (pairs.images, 3))
    elif start == "gnss" and all_observed and observed_m is not None:
        centre = from_gnss(pairs, rotation, observed_m)
    else:
        centre = from_bases(pairs, length, rotation)
    centre, reason = by_directions(rays, rotation, centre, images, anywhere=start == "random")
    notes = [] if not reason else [f"projection centres are not adjusted by the directions of rays: {reason}"]
    if start == "gnss" and not all_observed:
        notes.append("not all of its images have an observed position: a component starts from its bases")
    return centre, notes


def _of_pairs(graph: PairGraph, image_ids: Ids, error: Float, wrong: Bool, triangles: Int) -> list[Note]:
    ids = np.asarray(image_ids)
    names = tuple(f"{ids[a]}-{ids[b]}" for a, b in zip(graph.left[wrong], graph.right[wrong]))
    text = f"{several(len(graph.left), 'pair')}, {int((triangles == 0).sum())} of them in no triangle; "
    notes = [Note("note", f"{text}the rotations of half of them fit within {np.degrees(np.median(error)):.2g} degrees")]
    if names:
        notes.append(
            Note("warning", f"left out: {several(len(names), 'pair')} against the rotations of the others", names)
        )
    return notes
