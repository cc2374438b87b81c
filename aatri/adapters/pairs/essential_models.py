"""Relative orientations without start as Models, with what is ambiguous and what is only turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.pairs.image_pairs import Pairs, models_of
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models, SecondOrientations, Turns
from aatri.geometry.vectors import finite_rows
from aatri.orientation.relative.essential import EssentialOrientations


def essential_models(block: Block, image_points: ImagePoints, pairs: Pairs, made: EssentialOrientations) -> Models:
    """Models of oriented pairs; second orientations of ambiguous ones; pairs without base."""
    formed = np.flatnonzero(made.found.formed)
    also = np.flatnonzero(finite_rows(made.second[formed]))
    turned = np.flatnonzero(finite_rows(made.turned))
    return replace(
        models_of(block, image_points, pairs, made.found),
        second_orientations=SecondOrientations(
            model=also.astype(np.int32),
            left_from_right=made.second[formed[also]][:, :, :3],
            base=made.second[formed[also]][:, :, 3],
        ),
        turns=Turns(
            left=pairs.left[turned],
            right=pairs.right[turned],
            left_from_right=made.turned[turned],
            sigma_rad=made.turned_sigma_rad[turned],
            points=made.turned_points[turned].astype(np.int32),
        ),
    )
