"""The examples in the docstrings of the geometry are what comes out."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import aatri.geometry

MODULES = [f"aatri.geometry.{module.name}" for module in pkgutil.iter_modules(aatri.geometry.__path__)]


@pytest.mark.parametrize("name", MODULES)
def test_examples_are_what_comes_out(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0
