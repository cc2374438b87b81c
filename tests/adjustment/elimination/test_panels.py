"""Panels in a file: the same bits, and nothing left behind; a panel and its factor."""

from __future__ import annotations

import errno
import gc
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.panels import Panels, PanelsInFile, PanelsInMemory
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.stepping.adjusted import factor_of
from aatri.errors import ResourceError
from tests.adjustment.block_problem import shared_problem
from tests.adjustment.test_solve import _many_fronts

SHAPES = [(5, 3), (4, 4), (0, 0), (7, 1)]


def _written() -> tuple[PanelsInFile, list[np.ndarray]]:
    rng = np.random.default_rng(0)
    given = [np.asfortranarray(rng.normal(size=shape)) for shape in SHAPES]
    panels = PanelsInFile(SHAPES)
    for k in (3, 0, 1):
        panels[k] = given[k]
    return panels, given


def _open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_what_is_read_is_what_was_written() -> None:
    panels, given = _written()
    for k in (0, 1, 3):
        found = panels[k]
        assert found.flags.f_contiguous
        assert (found == given[k]).all()


@pytest.mark.parametrize("nodes", [[3, 0, 1], [1], []])
def test_panels_come_in_the_order_asked_for_wherever_they_are(nodes: list[int]) -> None:
    in_file, given = _written()
    in_memory = PanelsInMemory(len(given))
    for k in (3, 0, 1):
        in_memory[k] = given[k]
    for panels in (in_file, in_memory):
        read = list(panels.in_order(nodes))
        assert [k for k, _ in read] == nodes
        assert all((panel == given[k]).all() for k, panel in read)


def test_no_more_than_one_panel_is_read_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    panels, _ = _written()
    read: list[int] = []
    by_place = PanelsInFile.__getitem__

    def counted(self: PanelsInFile, k: int) -> np.ndarray:
        read.append(k)
        return by_place(self, k)

    monkeypatch.setattr(PanelsInFile, "__getitem__", counted)
    for number, _ in enumerate(panels.in_order([3, 0, 1, 3, 0]), 1):
        assert len(read) <= number + 1
    assert read == [3, 0, 1, 3, 0]


def test_an_error_of_reading_ahead_comes_where_the_panel_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    panels, _ = _written()
    by_place = PanelsInFile.__getitem__

    def torn(self: PanelsInFile, k: int) -> np.ndarray:
        if k == 0:
            raise OSError(errno.EIO, "Input/output error")
        return by_place(self, k)

    monkeypatch.setattr(PanelsInFile, "__getitem__", torn)
    each = panels.in_order([3, 0, 1])
    assert next(each)[0] == 3
    with pytest.raises(OSError, match="Input/output"):
        next(each)


@pytest.mark.parametrize("make", [lambda: PanelsInFile([(5, 2)]), lambda: PanelsInMemory(1)])
def test_a_panel_is_kept_while_its_front_is_used_again(make: Callable[[], Panels]) -> None:
    panels = make()
    front = np.asfortranarray(np.arange(25.0).reshape(5, 5))
    panels[0] = front[:, :2]
    front[:] = 0.0
    assert (panels[0] == np.arange(25.0).reshape(5, 5)[:, :2]).all()


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="open files are counted in /proc")
def test_nothing_is_left_behind(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    gc.collect()
    before = _open_files()
    panels, _ = _written()
    assert _open_files() == before + 1
    panels.clear()
    assert _open_files() == before
    again, _ = _written()
    del again
    assert _open_files() == before
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    with pytest.raises(ResourceError, match=r"no room for the factor of 1.9e-07 GB \(No space left on device\)"):
        PanelsInFile([(6, 4)])


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_solution_with_and_without_spilling(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    _many_fronts(monkeypatch)
    unknowns, records, start = shared_problem(1, n_kept=14, n_points=40)
    kept = adjust_large(unknowns, records, start, threads=threads)
    spilled = adjust_large(unknowns, records, start, threads=threads, memory_gb=0.0, solver="direct")
    assert spilled.problem.spill
    assert not kept.problem.spill
    for name, value in kept.state.items():
        np.testing.assert_allclose(spilled.state[name], value, rtol=1e-12, atol=1e-12)
    expected, found = marginal_covariances(kept), marginal_covariances(spilled)
    for name, covariance in expected.groups.items():
        np.testing.assert_allclose(found.groups[name], covariance, rtol=1e-9, atol=1e-12)
    assert spilled.cost == pytest.approx(kept.cost, rel=1e-12)


def test_a_factor_whose_file_was_given_back_is_made_again_where_it_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _many_fronts(monkeypatch)
    unknowns, records, start = shared_problem(1, n_kept=14, n_points=40)
    spilled = adjust_large(unknowns, records, start, memory_gb=0.0, solver="direct")
    kept = replace(spilled, factored=factor_of(spilled))
    assert factor_of(kept) is kept.factored
    expected = marginal_covariances(kept)
    assert kept.factored is not None
    kept.factored.factor.clear()
    with pytest.raises(AssertionError, match="given back"):
        kept.factored.factor.panel(0)
    assert factor_of(kept) is not kept.factored
    for name, covariance in marginal_covariances(kept).groups.items():
        np.testing.assert_array_equal(covariance, expected.groups[name])


@pytest.mark.parametrize("by_inverses", [False, True])
def test_a_panel_is_factorised_as_the_whole_matrix_would_be(by_inverses: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lapack, "BY_INVERSES", by_inverses)
    n, m, rng = 310, 2 * lapack.DIVIDED + 20, np.random.default_rng(1)
    A = rng.standard_normal((n, 2 * n))
    N = A @ A.T
    F = np.asfortranarray(N)
    assert lapack.cholesky_panel(F, m) == 0
    L = np.linalg.cholesky(N)
    np.testing.assert_allclose(np.tril(F)[:, :m], L[:, :m], rtol=0, atol=1e-10 * np.abs(L).max())
    rest = N[m:, m:] - L[m:, :m] @ L[m:, :m].T
    np.testing.assert_allclose(np.tril(F[m:, m:]), np.tril(rest), rtol=0, atol=1e-10 * np.abs(N).max())
