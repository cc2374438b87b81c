"""Principal distances that the graph begins with: where they are open, those with which rotations of pairs fit."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adapters.pairs.models import graph_of, turns_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.ids import shown
from aatri.notes import Note
from aatri.orientation.graph.component_bodies import open_distances
from aatri.orientation.graph.limits import FEWEST_POINTS, LOOSE_DISTANCE
from aatri.orientation.graph.starting_distance import near_images, rotation_misfit, starting_factor

MOST_PAIRS = 60
"""Pairs of a large block that are oriented with each principal distance on trial."""

SAMPLES_ON_TRIAL = 50
"""Most samples of a pair there: with the right principal distance most points fit, and a few samples are enough."""


def with_distances(block: Block, factor: Float) -> Block:
    """The block with its principal distances times (n_cameras,)."""
    cameras = replace(block.cameras, principal_distance_mm=block.cameras.principal_distance_mm * factor)
    return replace(block, cameras=cameras)


def starting_distances(
    block: Block, images: Int, models_of: Callable[[Block, Int], Models]
) -> tuple[Float, list[Note]]:
    """Factors on the principal distances of the cameras, (n_cameras,), and what there is to say of them.

    Parameters
    ----------
    images : (m, 2) int
        Rows in images of the pairs.
    models_of : callable
        Block and pairs -> their relative orientations.
    """
    factor, notes = np.ones(len(block.cameras)), list[Note]()
    for cameras, share in open_distances(block):
        of_pair = np.isin(block.images.camera[images], cameras).any(axis=1)
        if share[cameras].max() < LOOSE_DISTANCE or not of_pair.any():
            continue
        own = images[of_pair]
        own = own[near_images(own[:, 0], own[:, 1], len(block.images), MOST_PAIRS)]

        def misfit(f: float, cameras: Int = cameras, own: Int = own) -> float:
            trial = factor.copy()
            trial[cameras] *= f
            models = models_of(with_distances(block, trial), own)
            return f * rotation_misfit(graph_of(models, FEWEST_POINTS, FEWEST_POINTS), turns_of(models))

        best = starting_factor(misfit)
        if best != 1.0:
            stated, fitting = np.degrees(misfit(1.0)), np.degrees(misfit(best)) / best
            factor[cameras] = best
            c_mm = block.cameras.principal_distance_mm[cameras[0]]
            text = (
                f"camera {shown(block.cameras.id[cameras])}: rotations of pairs fit within {fitting:.2g} degrees with "
                f"a principal distance of {c_mm * best:.4g} mm, within {stated:.2g} with {c_mm:.4g} mm as stated; this "
                "stage uses the former, the bundle estimates it"
            )
            notes.append(Note("note", text))
    return factor, notes
