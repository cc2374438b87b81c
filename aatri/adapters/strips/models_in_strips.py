"""Free strips in metres: their scale by control, scale numbers of images, and models in their strip, kept apart.

    m = sqrt( sum |X - X0|^2 / sum |x - x0|^2 )        metres of a first base, over the control points of a strip
    scale number of an image = m z / c,                 z the median distance of its points along its axis,
                                                        each point of its two models once

Source: lecture notes, free strips: X_S2 = X_S1 + m B_x, m the denominator of the photo scale (A404).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.strips.model_chains import Chain
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import ImageScales, PlacedPoints, Strips, StripScales
from aatri.observations.control import control_of
from aatri.orientation.strips.chain import ChainedModels
from aatri.orientation.strips.joints import ModelTable


def with_models_apart(
    strips: Strips, block: Block, models: Models, table: ModelTable, formed: ChainedModels, chains: Sequence[Chain]
) -> Strips:
    """The strips with their scales, those of their images, and all points of all models."""
    strip_of = np.full(len(models.orientations), -1)
    for k, chain in enumerate(chains):
        strip_of[chain.models] = k
    model = table.of_row()
    rows = np.flatnonzero(strip_of[model] >= 0)
    strip, point = strip_of[model[rows]], table.point[rows]
    metres, counts = _metres(block, strips)
    x = formed.placed[rows]
    images = strips.strip_images
    number = np.full(len(images), np.nan)
    c = block.cameras.principal_distance_mm[block.images.camera[images.image]]
    ends = models.orientations.left[model[rows]], models.orientations.right[model[rows]]
    for k, (s, image) in enumerate(zip(images.strip.tolist(), images.image.tolist())):
        seen = np.flatnonzero((strip == s) & ((ends[0] == image) | (ends[1] == image)))
        once = seen[np.unique(point[seen], return_index=True)[1]]  # most points of an image are in both its models
        away = -(x[once] - images.position[k]) @ images.strip_from_image[k][:, 2]
        number[k] = metres[s] * float(np.median(away)) / (1e-3 * c[k]) if len(once) else np.nan
    per_strip = [number[(images.strip == s) & np.isfinite(number)] for s in range(len(metres))]
    return replace(
        strips,
        scales=StripScales(
            strip=np.arange(len(metres), dtype=np.int32),
            control_points=counts.astype(np.int32),
            metres=metres,
            scale_number=np.array(
                [float(np.median(scale_numbers)) if len(scale_numbers) else np.nan for scale_numbers in per_strip]
            ),
        ),
        image_scales=ImageScales(strip=images.strip, image=images.image, scale_number=number),
        placed_points=PlacedPoints(
            strip=strip.astype(np.int32),
            model=models.orientations.id[model[rows]],
            point=point.astype(np.int32),
            xyz=x,
            xyz_m=x * metres[strip][:, None],
        ),
    )


def _metres(block: Block, strips: Strips) -> tuple[Float, Int]:
    """Length of the first base of each strip, m, NaN with fewer than two control points; how many it has."""
    control, p = control_of(block), strips.strip_points
    full = control.given.all(axis=1)
    X = np.full((len(block.points), 3), np.nan)
    X[control.point[full]] = control.xyz_m[full]
    metres, counts = np.full(len(strips.strips), np.nan), np.zeros(len(strips.strips), dtype=np.int64)
    for s in range(len(metres)):
        rows = np.flatnonzero((p.strip == s) & np.isfinite(X[p.point]).all(axis=1))
        counts[s] = len(rows)
        if len(rows) > 1:
            ground, inside = X[p.point[rows]], p.xyz[rows]
            squares = [((places - places.mean(axis=0)) ** 2).sum() for places in (ground, inside)]
            metres[s] = np.sqrt(squares[0] / squares[1])
    return metres, counts
