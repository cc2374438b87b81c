"""The examples in the docstrings of the geometry, of arrays and of what `import aatri` gives are what comes out."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import aatri.api
import aatri.geometry

MODULES = ["aatri.arrays"] + [
    f"{room.__name__}.{module.name}"
    for room in (aatri.geometry, aatri.api)
    for module in pkgutil.iter_modules(room.__path__)
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_are_what_comes_out(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0
