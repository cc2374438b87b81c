"""Known couplings are named with the right advice, at the right level."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.camera.parameters.advice import advise, kinds_of_columns
from aatri.camera.parameters.catalogue import parameter_set
from aatri.camera.parameters.parameter_set import scale_of_format

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
        ("x0", "phi of image 3", "tilt"),
        ("b3", "b4", "hold or weight"),
    ],
)
def test_known_couplings_are_explained(first: str, second: str, words: str) -> None:
    assert words in advise([(first, second, -0.98)])[0].text


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("brown21", {"a21": "c", "a19": "x0", "a20": "y0", "a16": "k1", "a1": "b1", "a13": "", "a3": ""}),
        ("aicon", {"c": "c", "A1": "k1", "A3": "k1", "B1": "p1", "B2": "p2", "C1": "b1", "C2": "b2"}),
        ("brown_conrady", {"c": "c", "x0": "x0", "k1": "k1", "k3": "k1", "p1": "p1", "b1": "b1", "b2": "b2"}),
        ("ebner12", {"b1": "", "b2": "", "b3": ""}),
    ],
)
def test_parameters_are_known_by_what_their_columns_do(name: str, kinds: dict[str, str]) -> None:
    chosen = parameter_set(name)
    scale = scale_of_format([115.0, 110.0], 150.0)
    xy = np.random.default_rng(1).uniform(-110, 110, (300, 2))
    found = kinds_of_columns(chosen.parameters, chosen.basis(xy, scale), xy)
    assert {key: found[key] for key in kinds} == kinds


def test_advice_goes_by_the_kind_and_not_by_the_name() -> None:
    assert "half a change of c" in advise([("c", "b1", 0.98)])[0].text
    assert "hold or weight" in advise([("c", "b1", 0.98)], {"c": "c", "b1": ""})[0].text
    assert "nearly flat terrain" in advise([("a21", "Z0 of image 3", 0.98)], {"a21": "c"})[0].text
