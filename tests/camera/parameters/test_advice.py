"""Known couplings are named with the right advice, at the right level."""

from __future__ import annotations

import pytest

from aatri.camera.parameters.advice import advise

# reference table: relief and design, max |correlation| of the principal distance with a Z0
TABLE = [
    ("flat, vertical, control only", 0.999998, True, False),
    ("flat, crossed strips 20 % higher", 0.999999, True, False),
    ("flat, 15 degrees oblique", 0.971, True, True),
    ("flat, GNSS 5 cm", 0.16, False, True),
    ("relief 5 %", 0.9996, True, False),
    ("relief 10 %", 0.998, True, True),
    ("relief 20 %", 0.997, True, True),
    ("relief 20 %, 15 degrees oblique", 0.836, False, True),
]


@pytest.mark.parametrize(("design", "rho", "warned", "determinable"), TABLE, ids=[row[0] for row in TABLE])
def test_principal_distance_and_height(design: str, rho: float, warned: bool, determinable: bool) -> None:
    found = advise([("c", "Z0 of image 4", rho)])
    assert bool(found) == warned
    if warned:
        assert found[0].determinable == determinable
        assert "GNSS" in found[0].text
        assert "oblique" in found[0].text


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("K2", "K3", "powers of the same radius"),
        ("k1", "k2", "powers of the same radius"),
        ("p1", "x0", "decentred lens"),
        ("y0", "p2", "decentred lens"),
        ("a21", "Z0 of image 3", "vertical images of nearly flat terrain"),
        ("a19", "X0 of image 3", "shift of the principal point"),
        ("x0", "phi of image 3", "tilt"),
        ("b3", "b4", "hold or weight"),
    ],
)
def test_known_couplings_are_explained(first: str, second: str, words: str) -> None:
    assert words in advise([(first, second, -0.98)])[0].text
