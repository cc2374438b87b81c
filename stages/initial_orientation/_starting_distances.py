"""Principal distances that the graph begins with: where they are open, those with which rotations of pairs fit."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adapters.pairs.models import graph_of, turns_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.ids import shown
from aatri.notes import Note
from aatri.orientation.graph.component_bodies import open_distances
from aatri.orientation.graph.limits import FEWEST_POINTS, LOOSE_DISTANCE
from aatri.orientation.graph.starting_distance import pairs_around_one_image, rotation_errors, starting_factor

MOST_PAIRS = 60
"""Pairs of a large block that are oriented with each principal distance on trial."""

MOST_CAMERAS = 20
"""Cameras whose principal distance is looked for, each with some 25 trials; others begin as stated."""

SAMPLES_ON_TRIAL = 50
"""Most samples of a pair there: with the right principal distance most points fit, and a few samples are enough."""


def with_distances(block: Block, factor: Float) -> Block:
    """The block with its principal distances times (n_cameras,)."""
    cameras = replace(block.cameras, principal_distance_mm=block.cameras.principal_distance_mm * factor)
    return replace(block, cameras=cameras)


def starting_distances(
    block: Block, image_points: ImagePoints, images: Int, models_of: Callable[[Block, ImagePoints, Int], Models]
) -> tuple[Float, list[Note]]:
    """Factors on the principal distances of the cameras, (n_cameras,), and what there is to say of them.

    Parameters
    ----------
    images : (m, 2) int
        Rows in images of the pairs.
    models_of : callable
        Block, image points and pairs -> their relative orientations.
    """
    factor, notes = np.ones(len(block.cameras)), list[Note]()
    for cameras, share in open_distances(block)[:MOST_CAMERAS]:
        is_own = np.isin(block.images.camera[images], cameras)
        within = is_own.all(axis=1)  # pairs with another camera, whose distance may be wrong, only where there are few
        own = images[within if np.count_nonzero(within) >= MOST_PAIRS // 2 else is_own.any(axis=1)]
        if share[cameras].max() < LOOSE_DISTANCE or not len(own):
            continue
        own = own[pairs_around_one_image(own[:, 0], own[:, 1], len(block.images), MOST_PAIRS)]
        rows = image_points.measurements
        few = replace(image_points, measurements=rows.take(np.flatnonzero(np.isin(rows.image, own))))

        def errors_of(f: float, cameras: Int = cameras, few: ImagePoints = few, own: Int = own) -> Float:
            trial = factor.copy()
            trial[cameras] *= f
            models = models_of(with_distances(block, trial), few, own)
            return rotation_errors(graph_of(models, FEWEST_POINTS, FEWEST_POINTS), turns_of(models))

        best = starting_factor(errors_of)
        factor[cameras] = best.factor
        if best.factor != 1.0:
            c_mm = block.cameras.principal_distance_mm[cameras[0]]
            fitting, stated = np.degrees([best.misfit_rad, best.stated_rad])
            text = (
                f"camera {shown(block.cameras.id[cameras])}: rotations of pairs fit within {fitting:.2g} degrees with "
                f"{c_mm * best.factor:.4g} mm as principal distance, within {stated:.2g} with {c_mm:.4g} mm as stated; "
                "this stage uses the former, the bundle estimates it"
            )
            notes.append(Note("note", text))
    return factor, notes
