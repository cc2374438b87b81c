"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import os
import sys
from collections import Counter
from pathlib import Path

import pytest

from aatri.pipeline.methods import compile_kernels
from aatri.pipeline.methods.kernel_cache import use_kernel_cache

# as Python does unless it is told otherwise: else each of the hundreds of processes of the tests compiles all modules
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# before NumPy is imported: as in the processes of a run, so that workers of pytest do not wait for each other's threads
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# before Numba is imported: an edit of a kernel leads to another folder, in the processes of tests too
use_kernel_cache()

# collecting 8,000 tests makes millions of objects and no garbage worth looking for
gc.disable()

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Caches are those of one run of the tests, shared by its processes; compiled code takes long, and outlives it."""
    base = tmp_path_factory.getbasetemp()
    of_run = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    monkeypatch.setenv("XDG_CACHE_HOME", str(of_run / "cache"))


@pytest.fixture(autouse=True)
def _no_helper_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels are compiled and stages imported here: what `check` and `new` ask of another process is done here, too.

    That they ask it is seen by `test_where_nothing_is_compiled_yet_nothing_is_compiled`, and what errors
    come back by `test_what_another_process_refuses_is_told_as_here`.
    """
    monkeypatch.setattr(compile_kernels, "without_compiler", lambda function, *arguments: function(*arguments))


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


@pytest.fixture(scope="session")
def interchange(shared_data: Path) -> Path:
    """Folder of real files of other programs, likewise."""
    if not (shared_data / "interchange").is_dir():
        pytest.skip(f"real data not present: {shared_data / 'interchange'}")
    return shared_data / "interchange"


def _leaves_out_slow_tests(config: pytest.Config) -> bool:
    """Unless a mark is asked for, or tests by name."""
    by_name = config.option.keyword or any("::" in argument for argument in config.args)
    return not config.option.markexpr and not by_name


def _unmark_first_cases(items: list[pytest.Item]) -> None:
    """Of a parametrised test marked `slow(after=n)` the first n cases stand for all among the quick tests."""
    cases: Counter[str] = Counter()
    for item in items:
        test = item.nodeid.partition("[")[0]
        marks = [mark for mark in item.own_markers if mark.name == "slow" and cases[test] < mark.kwargs.get("after", 0)]
        item.own_markers = [mark for mark in item.own_markers if mark not in marks]
        cases[test] += 1


@pytest.hookimpl(tryfirst=True)  # before `-m` is looked at
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What takes half a second is run by `-m slow`."""
    _unmark_first_cases(items)
    if _leaves_out_slow_tests(config):
        slow = [item for item in items if item.get_closest_marker("slow")]
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if not item.get_closest_marker("slow")]


def pytest_collection_finish() -> None:
    """From here on garbage is collected, less often than usual; what is there now is looked at no more."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was left out."""
    if _leaves_out_slow_tests(config):
        terminalreporter.write_line("slow tests are left out; they are run by: pytest -n 2 -m slow")
