"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aatri.pipeline.methods.kernel_cache import use_kernel_cache

# before NumPy is imported: as in the processes of a run, so that workers of pytest do not wait for each other's threads
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# before Numba is imported: an edit of a kernel leads to another folder, in the processes of tests too
use_kernel_cache()

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Caches are those of one run of the tests, shared by its processes; compiled code takes long, and outlives it."""
    base = tmp_path_factory.getbasetemp()
    of_run = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    monkeypatch.setenv("XDG_CACHE_HOME", str(of_run / "cache"))


@pytest.fixture(autouse=True)
def _disk_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run waits for the disk some fifty times, milliseconds each; only a power cut tells whether it has."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real data sets; tests that need it are skipped where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"real data not present: {SHARED_DATA}")
    return SHARED_DATA


def _leaves_out_slow_tests(config: pytest.Config) -> bool:
    """Unless a mark is asked for, or tests by name."""
    return not config.option.markexpr and not any("::" in argument for argument in config.args)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What takes seconds is run by `-m slow`."""
    if _leaves_out_slow_tests(config):
        slow = [item for item in items if item.get_closest_marker("slow")]
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if not item.get_closest_marker("slow")]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was left out."""
    if _leaves_out_slow_tests(config):
        terminalreporter.write_line("slow tests are left out; they are run by: pytest -n 2 -m slow")
