"""Of the results of several starts the best one counts; what is known of a start is not computed again."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.orientation.bundle import from_afar
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.settings import BundleSettings
from aatri.progress import SILENT
from tests.orientation.bundle.made_bundle import made_bundle


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
    monkeypatch.setattr(from_afar, "_are_alike", lambda *_: False)
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


@pytest.mark.parametrize(("off_m", "adjustments"), [(1e-6, 1), (1.0, 4)])
def test_a_start_that_is_the_one_before_leads_to_what_that_has_led_to(
    monkeypatch: pytest.MonkeyPatch, off_m: float, adjustments: int
) -> None:
    """Rotations held at first or not, most starts of one weight are the same but for rounding."""
    parts, starts, adjusted = made_bundle(), list[BundleInput](), list[BundleInput]()

    def start(inputs: BundleInput, *_: Any) -> BundleInput:
        starts.append(replace(inputs, xyz_m=inputs.xyz_m + off_m * len(starts)))
        return starts[-1]

    def failing(inputs: BundleInput, *_: Any, **__: Any) -> Any:
        adjusted.append(inputs)
        raise ConvergenceError("no")

    monkeypatch.setattr(from_afar, "start_in_space", start)
    monkeypatch.setattr(from_afar, "adjust_bundle", failing)
    assert from_afar._best_restart(parts.together(), None, SILENT, BundleSettings()) is None
    assert (len(starts), len(adjusted)) == (4, adjustments)


def test_without_any_result_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _best(monkeypatch, None, [None] * 4) is None
