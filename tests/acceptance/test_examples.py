"""The examples in docstrings are what comes out."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

import aatri

HOUSE = Path(aatri.__file__).parent
MODULES = sorted(path for path in HOUSE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", MODULES, ids=[path.stem for path in MODULES])
def test_examples_are_what_comes_out(path: Path) -> None:
    name = ".".join(path.relative_to(HOUSE.parent).with_suffix("").parts)
    outcome = doctest.testmod(importlib.import_module(name))
    assert outcome.attempted > 0
    assert outcome.failed == 0
