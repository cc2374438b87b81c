"""Which of the results of several starts counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.orientation.bundle import from_afar
from aatri.orientation.bundle.settings import BundleSettings
from aatri.progress import SILENT


def _result(cost: float, over: int = 0) -> SimpleNamespace:
    return SimpleNamespace(adjusted=SimpleNamespace(cost=cost, sigma0=9.0, history=()), over=np.arange(3) < over)


def _best(monkeypatch: pytest.MonkeyPatch, first: Any, found: list[Any]) -> Any:
    """The best of a first result and of those of the starts by object space, none of them to be trusted at once."""
    ends = iter(found)

    def adjusted(*_: Any, **__: Any) -> Any:
        end = next(ends)
        if end is None:
            raise ConvergenceError("no")
        return end

    monkeypatch.setattr(from_afar, "adjust_bundle", adjusted)
    monkeypatch.setattr(from_afar, "start_in_space", lambda given, *_: given)
    monkeypatch.setattr(from_afar, "has_shapes", lambda _: False)
    monkeypatch.setattr(from_afar, "turned_over", lambda _, result: result.over)
    monkeypatch.setattr(from_afar, "_resected", lambda _, best, *__: best)
    given: Any = SimpleNamespace(rays=(), observed=())
    return from_afar._best_restart(given, first, SILENT, BundleSettings())


def test_the_least_cost_counts_whichever_start_gave_it(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = [_result(c) for c in (7.0, 3.0, 5.0, 4.0)]
    assert _best(monkeypatch, _result(6.0), costs) is costs[1]
    kept = _result(2.0)
    assert _best(monkeypatch, kept, costs) is kept
    assert _best(monkeypatch, None, [None, *costs[:3]]) is costs[1]


def test_images_turned_over_count_before_the_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over flat ground the residuals of images turned over are as small as the right ones."""
    sound = _result(9.0)
    ends = [_result(1.0, over=2), sound, _result(0.5, over=1), _result(10.0)]
    assert _best(monkeypatch, _result(0.1, over=3), ends) is sound


def test_without_any_result_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _best(monkeypatch, None, [None] * 4) is None
