"""Sets of additional parameters whose terms are functions of the ideal coordinates: formed anew until they agree.

    (x, y) + K(x + ...) p,    K at the coordinates that p itself has corrected

An adjustment takes K as constant; with that of its own result it is made again, until the corrections stay the same.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adapters.bundle.bundle_input import with_parameters
from aatri.adapters.cameras.unknowns import additional_parameters
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.observations.observed import Given
from aatri.observations.parameters import ParameterRows
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult, from_result
from aatri.orientation.bundle.rounds import Round

from ._self_calibration import ChosenSet

IDEAL_MM = 1e-6
"""Corrections that change by less are those of ideal coordinates."""

MOST_ROUNDS = 10
"""Each leaves some per cent of the change."""


def at_ideal_coordinates(
    source: Given,
    chosen: ChosenSet | None,
    done: Round,
    adjust: Callable[[BundleInput], BundleResult],
) -> Round:
    """The adjusted block with the terms of an ideal set at its ideal coordinates; other sets are what they are."""
    if source.image_points is None or chosen is None or not any(part.parameters.ideal for part in chosen.parts):
        return done
    for _ in range(MOST_ROUNDS):
        rows = _formed_anew(source.block, source.image_points, chosen, done.result)
        if rows is None:
            break
        anew = with_parameters(source, from_result(done.given, done.result), rows)
        done = replace(done, given=anew, result=adjust(anew))
    return done


def _formed_anew(
    block: Block, image_points: ImagePoints, chosen: ChosenSet, result: BundleResult
) -> tuple[ParameterRows, ...] | None:
    """The parameters with other terms; None where these change nothing."""
    parts, m = {part.group: part for part in chosen.parts}, image_points.measurements
    mine = [p for p in result.parameters if p.given.group in parts]
    before = _correction(mine)
    ideal = replace(image_points, measurements=replace(m, xy_mm=m.xy_mm + before))
    rows = {}
    for p in mine:
        part = parts[p.given.group]
        basis = additional_parameters(block, ideal, part.parameters, part.per, None).basis
        rows[p.given.group] = replace(p.given, basis=basis)
    after = _correction([replace(p, given=rows[p.given.group]) for p in mine])
    if np.abs(np.where(m.active[:, None], after - before, 0.0)).max(initial=0.0) < IDEAL_MM:
        return None
    return tuple(rows.get(p.given.group, p.given) for p in result.parameters)


def _correction(parameters: list[AdjustedParameters]) -> Float:
    """What the parameters add to all image points, (n, 2) mm."""
    found = np.zeros((len(parameters[0].given.block), 2))
    for p in parameters:
        assert p.given.basis is not None
        found += np.einsum("nij,nj->ni", p.given.basis, p.value[p.given.block])
    return found
