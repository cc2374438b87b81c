"""Sets of the user's own."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.camera.parameters.parameter_set import (
    correction,
)
from aatri.camera.parameters.user import user_set
from aatri.errors import PluginError
from tests.camera.parameters.test_sets import FILM, POINTS

GOOD = """
names = ["s", "t"]
def basis(x_mm, y_mm):
    K = np.zeros((len(x_mm), 2, 2))
    K[:, 0, 0] = np.sin(x_mm / 50)
    K[:, 1, 1] = y_mm / 115
    return K
"""


def test_a_set_of_the_users_own() -> None:
    s = user_set(GOOD, "my_set.py")
    assert s.parameters == ("s", "t")
    found = correction(s, FILM, np.array([0.01, 0.02]), POINTS)
    assert found == pytest.approx(np.stack([0.01 * np.sin(POINTS[:, 0] / 50), 0.02 * POINTS[:, 1] / 115], axis=1))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("names = [", "my_set.py:1"),
        ("import nothing_like_it", "ModuleNotFoundError"),
        ("def basis(x, y): return 0", "names is None"),
        (GOOD.replace('"t"', '"s"'), "'s' twice"),
        (GOOD.replace("def basis", "def base"), "no function basis"),
    ],
)
def test_a_faulty_set_of_the_users_own_is_refused(text: str, message: str) -> None:
    with pytest.raises(PluginError, match=message):
        user_set(text, "my_set.py")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("return K", "return K[:, :, :1]", r"shape \(40, 2, 1\), not \(40, 2, 2\)"),
        ("np.sin(x_mm / 50)", "np.nan", "not finite"),
        ("np.sin(x_mm / 50)", "z_mm", "NameError"),
    ],
)
def test_a_faulty_basis_of_the_users_own_is_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(PluginError, match=message):
        user_set(GOOD.replace(old, new), "my_set.py").basis(POINTS, FILM)
