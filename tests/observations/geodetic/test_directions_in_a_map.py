"""Directions, azimuths and angles that are reduced to the map are bearings between its coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.orientation.bundle.block import start_of
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.stages.hand_block import ground_rows, hand, read, start

ORIGIN = (640_000.0, 4_500_000.0, 800.0)
"""140 km from the central meridian: arcs and chords differ by some seconds over a kilometre."""


@pytest.mark.parametrize("reduced", ["map", "no"])
def test_residuals_of_bearings_in_the_map_are_nothing(reduced: str, tmp_path: Path) -> None:
    of = hand(ORIGIN)

    def bearing(a: int, b: int) -> float:
        d = of.xyz_m[b] - of.xyz_m[a]
        return float(np.degrees(np.arctan2(d[0], d[1])) % 360)

    rows = [
        f"azimuth,p00,p29,{bearing(0, 29)!r},0.0001,,,{reduced}",
        *(f"direction,p12,p{b:02},{(bearing(12, b) + 33) % 360!r},0.0001,s,,{reduced}" for b in (0, 5, 24)),
        f"angle,p05,p24,{(bearing(12, 24) - bearing(12, 5)) % 360!r},0.0001,,p12,{reduced}",
    ]
    tmp_path.joinpath("geodetic.csv").write_text("\n".join(["type,from,to,value,sigma,set,via,reduced", *rows]) + "\n")
    more = {"frames": {"map": {"axes": ["east", "north", "up"], "crs": "EPSG:32650"}}, "earth_curvature": "frame"}
    block, points = read(tmp_path, of, ground=ground_rows(of, [0, 5, 24, 29]), more=more)
    given = bundle_input(observation_source(block, points, start(of, block)), BundleOptions())
    state, found = start_of(given), {}
    for o in given.observed:
        if o.kind in ("azimuth", "direction", "angle"):
            found[o.kind] = o.records.evaluate(state, np.arange(len(o)))[0][:, 0]
    found["direction"] = found["direction"] - found["direction"].mean()
    seconds = {kind: np.degrees(np.abs(v).max()) * 3600 for kind, v in found.items()}
    assert set(seconds) == {"azimuth", "direction", "angle"}
    assert all((value < 2e-3) == (reduced == "map") for value in seconds.values()), seconds
