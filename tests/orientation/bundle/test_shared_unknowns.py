"""What too few observations are left to tell apart is held: a drift of positions of one time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.observations.drift import DRIFT, drift_term
from aatri.observations.positions import Positions, observed_positions
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from tests.orientation.bundle.made_bundle import made_bundle


def with_positions(use: np.ndarray, *, stated: np.ndarray) -> BundleInput:
    """The made-up block with positions: four without a drift, two of one group, of which some are stated and used."""
    given, rng = made_bundle().together(), np.random.default_rng(3)
    place = np.array([[x, y, 1500.0] for y in (0.0, 900.0) for x in (0.0, 600.0, 1200.0)]) - given.origin_m
    position, images = place + rng.normal(0, 0.1, (6, 3)), np.array(given.image_ids)
    shared = drift_term(np.full(2, "b"), np.array([-1.0, 1.0]), np.broadcast_to(stated[:, None], (2, 3)))
    observed = list(given.observed)
    for some, terms in ((np.array([0, 1, 3, 4]), []), (np.array([2, 5]), [shared])):
        n, at = len(some), some.astype(np.int32)
        rows = Positions(at, at, position[some], np.tile(0.01 * np.eye(3), (n, 1, 1)), np.zeros((n, 3)))
        (o,) = observed_positions(rows, np.zeros(3), images[some], None, terms)
        observed.append(replace(o, records=replace(o.records, active=use)) if terms else o)
    return replace(given, observed=tuple(observed))


def held_by(result: BundleResult) -> list[tuple[str, ...]]:
    return [note.ids for note in result.notes if "do not tell them" in note.text]


def test_a_drift_whose_positions_in_use_are_of_one_time_is_held_and_named() -> None:
    """As where the group was stated with these positions alone, which gives it no drift from the first."""
    use = np.array([True, False])
    result = adjust_bundle(with_positions(use, stated=np.array([True, True])))
    expected = adjust_bundle(with_positions(use, stated=use))
    np.testing.assert_allclose(result.xyz_m, expected.xyz_m, rtol=0, atol=1e-9)
    np.testing.assert_allclose(result.covariances[DRIFT], expected.covariances[DRIFT], rtol=1e-9, atol=1e-15)
    assert held_by(result) == [tuple(f"drift {axis} of drift b" for axis in "XYZ")]
    assert held_by(expected) == []


def test_a_drift_of_two_times_is_estimated() -> None:
    use = np.array([True, True])
    result = adjust_bundle(with_positions(use, stated=use))
    assert held_by(result) == []
    assert (np.diagonal(result.covariances[DRIFT], axis1=1, axis2=2) > 0).all()
