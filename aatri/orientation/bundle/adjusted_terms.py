"""Sets of additional parameters with their terms K at the adjusted coordinates, not at the measured ones.

The correction K(x, y) p of a measured point is linear in p: an adjustment takes K as constant. At measured coordinates
K has their errors, and v'Pv falls where p makes all coordinates smaller, and with them the errors: with n observations
c is wrong by up to n sigma_c / c of its standard deviations (30 images over flat ground without positions: by eleven
and fourteen). Adjusted coordinates are not correlated with the residuals, so that K'Pv = 0 has no such bias. Terms of
ideal coordinates are at those that p itself has corrected.

They are formed from the start where it fits, else from an adjustment with those of the measured coordinates; the last
adjustment is repeated until the parameters are those by which its terms were formed.

Source: Fuller 1987, Measurement Error Models, 1.1 and 3.1 (errors in the coefficients attenuate what is estimated).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aatri.adjustment.records import Records, residuals
from aatri.adjustment.unknowns import State
from aatri.arrays import Float
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.image_points import observed_image_points
from aatri.observations.observed import Observed
from aatri.observations.parameters import ParameterRows
from aatri.orientation.bundle.block import BundleInput, start_of
from aatri.orientation.bundle.limits import FARTHEST_ADJUSTED, NEARLY_ADJUSTED
from aatri.orientation.bundle.result import Adjust, BundleResult, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock

SAME, IDEAL_MM = 1e-4, 1e-6
"""Change of a parameter, in its standard deviations, and of a correction at ideal coordinates, that is none."""

MOST_ROUNDS = 10


def adjusted_with_terms(block: BundleInput, adjust: Adjust, roughly: Adjust) -> BundleResult:
    """Adjust a block with terms at coordinates that are adjusted.

    Parameters
    ----------
    adjust : callable
        With the terms as they are.
    roughly : callable
        The same without standard deviations, where the start does not fit.
    """
    if not _has_terms(block):
        return adjust(block)
    formed = _formed(block, start_of(block), NEARLY_ADJUSTED)
    if formed is None:
        rough = roughly(block)
        formed = _formed(from_result(block, rough), rough.adjusted.state)
    return adjust(block if formed is None else formed)


def with_converged_terms(done: AdjustedBlock, adjust: Adjust, roughly: Adjust) -> AdjustedBlock:
    """The adjusted block, adjusted again until its parameters are those by which its terms were formed.

    Parameters
    ----------
    done : AdjustedBlock
        One that is weighted down keeps the terms it has.
    adjust : callable
        With the terms at the coordinates of its start.
    roughly : callable
        The same without standard deviations, on the way.
    """
    if not _has_terms(done.inputs):
        return done
    block, result = done.inputs, done.result
    sigma = {p.given.group: np.sqrt(np.einsum("nii->ni", p.covariance)) for p in result.parameters}
    latest = result
    for _ in range(0 if result.adjusted.down_weighted else MOST_ROUNDS):
        reformed = _formed(from_result(block, latest), latest.adjusted.state)
        if reformed is None or _settled(latest, reformed, sigma):
            break
        block, latest = reformed, roughly(reformed)
    if latest is not result:
        block = from_result(block, latest)
        result = adjust(block)
    terms = {p.given.group: p.given for p in result.parameters}
    return replace(done, inputs=_with_parameters(block, tuple(terms[p.group] for p in block.parameters)), result=result)


def _has_terms(block: BundleInput) -> bool:
    return block.rays is not None and any(p.terms is not None for p in block.parameters)


def _formed(block: BundleInput, state: State, most: float = np.inf) -> BundleInput | None:
    """The block with the terms at the coordinates of a state; None where it does not fit."""
    assert block.rays is not None
    o = _image_points(block)
    v = np.zeros(block.rays.xy_mm.shape)
    rows = np.flatnonzero(np.isfinite(block.rays.xy_mm).all(axis=1))
    v[rows] = residuals(o.records, state, rows)
    used = o.records.active & np.isfinite(v).all(axis=1)
    size = np.abs(v[used]) / o.records.sigmas()[used]
    if 2 * used.sum() < o.records.active.sum() or not size.size or np.median(size) > most:
        return None
    farthest_mm = FARTHEST_ADJUSTED * block.rays.c_mm[:, None]
    v = np.clip(v, -farthest_mm, farthest_mm)
    xy_mm = np.where(np.isfinite(block.rays.xy_mm + v), block.rays.xy_mm + v, 0.0)
    correction = np.zeros_like(xy_mm)
    for p in block.parameters:
        if p.ideal and p.basis is not None:
            correction += np.einsum("nij,nj->ni", p.basis, state[p.group][p.block])
    parameters = [
        p
        if p.terms is None
        else replace(p, basis=p.terms(xy_mm + correction if p.ideal else xy_mm), formed_by=state[p.group].copy())
        for p in block.parameters
    ]
    return _with_parameters(block, tuple(parameters))


def _settled(result: BundleResult, reformed: BundleInput, sigmas: Mapping[str, Float]) -> bool:
    """Whether the terms of a result are those that it would form."""
    active = _image_points(reformed).records.active
    for p, reformed_terms in zip(result.parameters, reformed.parameters, strict=True):
        if p.given.terms is None:
            continue
        if p.given.formed_by is None:
            return False
        sigma = sigmas[p.given.group]
        moved = np.abs(p.value - p.given.formed_by) > SAME * np.where(np.isfinite(sigma), sigma, np.abs(p.value))
        if (moved & p.given.free).any():
            return False
        if p.given.ideal:
            assert reformed_terms.basis is not None
            assert p.given.basis is not None
            change = np.einsum("nij,nj->ni", reformed_terms.basis - p.given.basis, p.value[p.given.block])
            if np.abs(change[active]).max(initial=0.0) >= IDEAL_MM:
                return False
    return True


def _image_points(block: BundleInput) -> Observed:
    return next(o for o in block.observed if o.kind == IMAGE_POINT)


def _with_parameters(block: BundleInput, parameters: tuple[ParameterRows, ...]) -> BundleInput:
    """The block with other terms; weights, rejections and start values stay."""
    assert block.rays is not None
    o = _image_points(block)
    records = observed_image_points(block.rays, parameters, o.names, o.group)[0].records
    observed = tuple(_with_records(other, records) if other is o else other for other in block.observed)
    return replace(block, observed=observed, parameters=parameters)


def _with_records(unchanged: Observed, records: Records) -> Observed:
    """Observations by other records, with the weights and rejections that they have."""
    records = replace(records, whitener=unchanged.records.whitener, active=unchanged.records.active)
    unreduced = None if unchanged.unreduced is None else _with_records(unchanged.unreduced, records)
    return replace(unchanged, records=records, unreduced=unreduced)
