"""What a problem will take is told before, and keeps within the limit."""

from __future__ import annotations

import mmap
import shutil
import sys
import tracemalloc

import numpy as np
import pytest

from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.iterative.forecast import Forecast, forecast, memory_limit, resident_bytes, within_limit
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.whitening import whitener_of_sigmas
from tests.adjustment.block_problem import _along, _group, _observed, _prior

N_KEPT, N_POINTS, RAYS = 300, 900, 3


def _tangled(n_kept: int = N_KEPT, n_points: int = N_POINTS):
    """Points that meet any three kept blocks: no good separators, large fronts."""
    rng = np.random.default_rng(0)
    kept = np.argsort(rng.random((n_points, n_kept)), axis=1)[:, :RAYS].ravel().astype(np.int32)
    point = np.repeat(np.arange(n_points), RAYS).astype(np.int32)
    evaluate = _observed(rng, (("a", 6), ("p", 3)), (kept, point))
    ones = np.ones(len(kept), dtype=bool)
    records = (
        Records("ray", (("a", kept), ("p", point)), evaluate, whitener_of_sigmas(np.ones((len(kept), 2))), ones),
        _prior("a", n_kept, 6),
    )
    unknowns = (
        _group("p", np.ones((n_points, 3), bool), eliminated=True),
        _group("a", np.ones((n_kept, 6), bool), position=_along(n_kept)),
    )
    return unknowns, records, {"a": np.zeros((n_kept, 6)), "p": np.zeros((n_points, 3))}


class _Log:
    """A reporter that keeps what is said."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, text: str) -> None:
        self.lines.append(text)

    warn = log

    def progress(self, done: int, total: int, text: str = "") -> None:
        """Progress is not kept."""


def test_a_worker_with_less_memory_than_the_machine_keeps_within_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    of_machine = memory_limit(None)
    monkeypatch.setenv("AATRI_MEMORY_OF_WORKER", "600000000")
    assert memory_limit(None) == 480_000_000
    assert memory_limit(3.0) == 3e9
    monkeypatch.setenv("AATRI_MEMORY_OF_WORKER", "1e18")
    assert memory_limit(None) == of_machine


def test_the_factor_is_as_large_as_predicted() -> None:
    unknowns, records, start = _tangled()
    problem = prepare(unknowns, records)
    factor = factorise(problem, start).factor
    kept = sum(factor.panel(k).nbytes for k, node in enumerate(problem.tree.nodes) if node.panel)
    assert forecast(problem).factor_bytes == kept


@pytest.mark.slow
@pytest.mark.parametrize("spill", [False, True])
def test_the_peak_of_memory_is_near_the_prediction(spill: bool) -> None:
    unknowns, records, start = _tangled()
    problem = prepare(unknowns, records, threads=1)
    index = forecast(problem).rays_bytes
    tracemalloc.start()
    try:
        limit = 0.001 if spill else None
        adjusted = adjust_large(unknowns, records, start, threads=1, solver="direct", memory_gb=limit)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert adjusted.problem.spill == spill
    predicted = forecast(adjusted.problem).memory_bytes(spill)
    assert index < 0.1 * predicted
    assert 0.7 * peak < predicted < 1.3 * peak


@pytest.mark.slow
def test_as_the_limit_falls_the_factor_goes_to_disk_and_then_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = _tangled()
    expected = forecast(prepare(unknowns, records))
    spilled, whole = expected.memory_bytes(spill=True), expected.memory_bytes()
    found = {}
    limits = {"fits": 1.01 * whole, "beside the block": 1.01 * whole, "on disk": 1.01 * spilled}
    for name, limit in {**limits, "neither": 0.99 * spilled}.items():
        log = _Log()
        resident = int(expected.index_bytes + 0.02 * whole) if name == "beside the block" else 0
        monkeypatch.setattr("aatri.adjustment.iterative.forecast.resident_bytes", lambda resident=resident: resident)
        problem = adjust_large(unknowns, records, start, memory_gb=limit / 1e9, reporter=log).problem
        found[name] = (problem.spill, problem.iterative is not None)
        assert log.lines[1].startswith(f"memory predicted: {whole / 1e6:.0f} MB (factor ")
        assert ("the factor goes to" in log.lines[2]) == (name in ("beside the block", "on disk"))
        assert ("conjugate gradients" in log.lines[2]) == (name == "neither")
    on_disk = {"beside the block": (True, False), "on disk": (True, False)}
    assert found == {"fits": (False, False), **on_disk, "neither": (False, True)}


@pytest.mark.parametrize(
    ("resident_gb", "free", "spill", "says"),
    [
        (0.0, 1e12, False, None),
        (0.9, 1e12, False, None),  # all of it is the index
        (1.2, 1e12, True, "prediction and the 0.3 GB that the process takes already are above the limit of 1.9 GB"),
        (1.2, 0.1e9, False, "the factor stays in memory, for /"),
    ],
)
def test_the_log_says_where_the_factor_is_and_the_index_counts_once(
    monkeypatch: pytest.MonkeyPatch, resident_gb: float, free: float, spill: bool, says: str | None
) -> None:
    """0.4 GB of factor, 0.3 of fronts, 1 of rays with 0.9 of their index: 1.7 GB with a limit of 1.9."""
    predicted = Forecast(1e9, 0.4e9, 0.3e9, 1.0e9, 0.9e9)
    log, problem = _Log(), prepare(*_tangled(20, 60)[:2], memory_gb=1.9)
    usage = shutil.disk_usage("/")._replace(free=int(free))
    for name, value in (("forecast", predicted), ("resident_bytes", int(1e9 * resident_gb))):
        monkeypatch.setattr(f"aatri.adjustment.iterative.forecast.{name}", lambda *_, value=value: value)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    assert within_limit(problem, log).spill == spill
    assert [says in line for line in log.lines[2:]] == [True] * (says is not None)


def test_where_the_system_does_not_tell_the_log_says_nothing_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    log, problem = _Log(), prepare(*_tangled(20, 60)[:2], memory_gb=0.6)
    for name, value in (("forecast", Forecast(1e9, 0.4e9, 0.3e9, 0.2e9)), ("resident_bytes", 0)):
        monkeypatch.setattr(f"aatri.adjustment.iterative.forecast.{name}", lambda *_, value=value: value)
    assert within_limit(problem, log).spill
    assert log.lines[2].startswith("the prediction is above the limit of 0.6 GB: the factor goes to ")


@pytest.mark.skipif(sys.platform != "linux", reason="nothing else tells")
def test_what_the_process_takes_counts_with_all_its_arrays() -> None:
    before, n = resident_bytes(), 32_000_000
    with mmap.mmap(-1, n) as new:  # an array may come to lie where others have been
        new.write(b"1" * n)
        assert resident_bytes() - before > 0.9 * n


@pytest.mark.slow
def test_a_disk_without_room_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = _tangled()
    expected = forecast(prepare(unknowns, records))
    usage = shutil.disk_usage("/")._replace(free=int(expected.factor_bytes))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    limit = 1.01 * expected.memory_bytes(spill=True) / 1e9
    assert not adjust_large(unknowns, records, start, memory_gb=limit).has_factor


def test_without_a_limit_a_share_of_the_machine_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 1000}.__getitem__)
    assert memory_limit(None) == pytest.approx(0.8 * 4096 * 1000)
    assert memory_limit(2.5) == 2.5e9


def test_blocks_without_positions_are_not_one_front() -> None:
    unknowns, records, start = _tangled(200, 120)
    placeless = tuple(_group(u.name, u.free, eliminated=u.eliminated) for u in unknowns)
    tree = prepare(placeless, records).tree
    assert tree.largest_front < 0.6 * 6 * 200
    assert tree.flops < 0.3 * (6 * 200) ** 3 / 3
    with_positions = adjust_large(unknowns, records, start)
    np.testing.assert_allclose(adjust_large(placeless, records, start).state["a"], with_positions.state["a"], atol=1e-9)
