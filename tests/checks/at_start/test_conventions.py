"""Geodetic observations written otherwise than declared: the kind and what its values look like are named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.artifacts.block import Block
from aatri.checks.at_start.conventions import other_conventions
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.geodetic_blocks import made

SURVEY = {
    "survey": {
        "distances": 20,
        "direction_sets": 4,
        "azimuths": 8,
        "angles": 8,
        "zenith_angles": 10,
        "height_differences": 8,
    }
}


def _told(block: Block) -> list[str]:
    given = bundle_input(observation_source(block, calibrated(block), None), BundleOptions())
    return [str(found) for found in other_conventions(block.geodetic, given)]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("kind", "written", "said"),
    [
        ("direction", lambda v: -v % (2 * np.pi), "counted counter-clockwise"),
        ("direction", lambda v: v / 0.9, "gon, read as degrees"),
        ("azimuth", lambda v: (v + np.pi) % (2 * np.pi), "counted from south"),
        ("azimuth", lambda v: (np.pi / 2 - v) % (2 * np.pi), "counted from east"),
        ("angle", lambda v: -v % (2 * np.pi), "counted counter-clockwise"),
        ("zenith", lambda v: np.pi / 2 - v, "elevations"),
        ("height_difference", lambda v: -v, "of opposite sign"),
        ("distance", lambda v: v / 0.3048, "in feet"),
    ],
)
def test_a_kind_written_otherwise_is_named(kind: str, written: Callable[[np.ndarray], np.ndarray], said: str) -> None:
    block = made(7, 1000.0, **SURVEY)
    g = block.geodetic
    wrong = replace(block, geodetic=replace(g, value=np.where(g.type == kind, written(g.value), g.value)))
    told = [text for text in _told(wrong) if text.startswith(f"{kind}:")]
    assert len(told) == 1
    assert said in told[0]


@pytest.mark.slow
def test_what_is_as_declared_is_not_named() -> None:
    for seed in range(1, 5):
        assert not _told(made(seed, 1000.0, **SURVEY))
    assert not _told(made(1, 1000.0, gross_errors={"geodetic": 6, "size_sigmas": (50.0, 500.0)}, **SURVEY))
