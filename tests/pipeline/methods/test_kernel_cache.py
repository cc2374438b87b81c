"""Compiled kernels: a folder per state of a module and of what it calls, found from any clone."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

pytest.importorskip("numba")

from aatri.pipeline.methods import compile_kernels, kernel_cache
from aatri.pipeline.methods.code_digest import PACKAGE, CodeReader
from aatri.pipeline.methods.compile_kernels import Compilation, kernels_of, missing
from aatri.pipeline.methods.kernel_cache import folder_name, is_compiled, remove_unused, use_kernel_cache
from aatri.pipeline.run import worker
from aatri.pipeline.run.context import LoggedContext
from aatri.pipeline.run.task import Task
from aatri.pipeline.store.cache import Cache
from tests.pipeline.methods.toy_kernels import clone

CONSENSUS = "aatri.orientation.relative.kernels.consensus"
CALL = """
import sys
from aatri.pipeline.methods.kernel_cache import use_kernel_cache
use_kernel_cache()
from field.kernels.outer import more
print(more(3.0), sum(more.stats.cache_hits.values()))
"""


@pytest.fixture(autouse=True)
def _variables_as_before() -> Iterator[None]:
    """Numba reads its variables again once those of a test are undone."""
    yield
    importlib.import_module("numba.core.config").reload_config()


def _called(folder: Path, cache: Path) -> str:
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", CALL], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.slow
def test_a_second_clone_compiles_nothing_and_an_edit_of_what_is_called_compiles_again(tmp_path: Path) -> None:
    cache = tmp_path / "numba"
    for name, factor in (("first", 2.0), ("second", 2.0), ("edited", 5.0)):
        clone(tmp_path / name, factor)
    assert _called(tmp_path / "first", cache) == "7.0 0"
    assert _called(tmp_path / "second", cache) == "7.0 1"
    assert _called(tmp_path / "edited", cache) == "16.0 0"
    assert _called(tmp_path / "first", cache) == "7.0 1"


@pytest.mark.slow
def test_modules_are_compiled_side_by_side_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *filter(None, sys.path)]))
    monkeypatch.syspath_prepend(str(tmp_path))
    kernels = clone(tmp_path, 2.0)
    assert use_kernel_cache() == tmp_path / "numba"
    assert missing(kernels) == kernels
    compilation = Compilation(kernels)
    assert compilation.progress() == "compiling, once: 0 of 2 modules ready"
    assert compilation.wait()
    assert compilation.progress() == ""
    assert missing(kernels) == {}
    assert len(list((tmp_path / "numba").iterdir())) == 2


def test_a_module_that_fails_is_left_to_who_needs_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    kernels = clone(tmp_path, 2.0)  # not on the path: no process can import it
    Compilation(kernels).wait()
    assert missing(kernels) == kernels


@pytest.mark.slow
def test_what_a_wheel_carries_is_not_compiled_unless_something_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Built in one folder, run from another: the same code, Numba and processor; then a later Numba."""
    kernels = clone(tmp_path / "built", 2.0)
    assert _called(tmp_path / "built", tmp_path / "carried") == "7.0 0"
    monkeypatch.setattr(kernel_cache, "CARRIED", tmp_path / "carried")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    kernel_cache.copy_compiled(kernels, kernel_cache.CARRIED, Path(os.environ[kernel_cache.VARIABLE]))
    assert missing(kernels) == {}
    assert _called(tmp_path / "built", tmp_path / "numba") == "7.0 1"
    assert sorted(p.name for p in (tmp_path / "numba").iterdir()) == sorted(
        p.name for p in (tmp_path / "carried").iterdir()
    )
    folder_name.cache_clear()
    monkeypatch.setattr(kernel_cache, "_compiler", lambda: ("99.0",))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "later"))
    kernel_cache.copy_compiled(kernels, kernel_cache.CARRIED, Path(os.environ[kernel_cache.VARIABLE]))
    assert missing(kernels) == kernels
    folder_name.cache_clear()


@pytest.mark.slow
def test_a_wheel_carries_what_the_cache_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A toy library whose kernels have been compiled: building its wheel compiles none of them again."""
    kernels = clone(tmp_path, 2.0)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name, value in (("NUMBA_CACHE_DIR", str(tmp_path / "numba")), (kernel_cache.PROCESSOR, kernel_cache.GENERIC)):
        monkeypatch.setenv(name, value)
    monkeypatch.setenv(kernel_cache.FEATURES, "")
    folder_name.cache_clear()
    kernel_cache._compiler.cache_clear()
    assert _called(tmp_path, tmp_path / "numba") == "7.0 0"
    asked = list[dict[str, Path]]()
    monkeypatch.setattr(compile_kernels, "_all_kernels", lambda: kernels)
    monkeypatch.setattr(compile_kernels, "Compilation", lambda of: asked.append(of) or SimpleNamespace(wait=bool))
    compile_kernels.compile_all(tmp_path / "compiled")
    assert asked == [{}]
    names = [sorted(p.name for p in (tmp_path / folder).iterdir()) for folder in ("compiled", "numba")]
    assert names[0] == names[1]
    folder_name.cache_clear()
    kernel_cache._compiler.cache_clear()


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_is_replaced_by_one_for_this_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    clone(tmp_path / "clone", 2.0)
    assert _called(tmp_path / "clone", tmp_path / "file" / "numba") == "7.0 0"
    assert not list((tmp_path / "clone").rglob("*.nbi"))


@pytest.mark.parametrize(
    ("flags", "environment", "processor"),
    [
        ("sse2 avx avx2 fma bmi1 bmi2 f16c abm movbe avx512f", {}, ("x86-64-v3", "")),
        ("sse2 avx", {}, (None, None)),
        ("sse2 avx avx2 fma bmi1 bmi2 f16c abm movbe", {"NUMBA_CPU_NAME": "generic"}, ("generic", None)),
    ],
    ids=["avx2", "older", "the user's own"],
)
def test_processors_with_avx2_are_one(
    flags: str, environment: dict[str, str], processor: tuple[str | None, str | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel_cache, "_described_processor", lambda: flags)
    for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(kernel_cache, "_has_generated_code", bool)  # as in a process that has not imported Numba
    use_kernel_cache()
    assert (os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")) == processor


def test_folders_that_nobody_has_used_for_long_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    kernels = clone(tmp_path / "clone", 2.0)
    long_ago = time.time() - (kernel_cache.KEPT_DAYS + 1) * 86_400
    names = [folder_name(module, file) for module, file in kernels.items()]
    for name in (*names, "old-1", "new-1"):
        (tmp_path / "numba" / name).mkdir(parents=True)
    for name in (*names, "old-1"):
        os.utime(tmp_path / "numba" / name, (long_ago, long_ago))
    remove_unused(tmp_path / "numba", kernels)
    assert {p.name for p in (tmp_path / "numba").iterdir()} == {*names, "new-1"}
    assert min(p.stat().st_mtime for p in (tmp_path / "numba").iterdir()) > time.time() - 3600
    assert not is_compiled("field.kernels.inner", kernels["field.kernels.inner"])  # a folder alone is not enough


def test_of_more_folders_than_are_kept_the_oldest_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    kernels = clone(tmp_path / "clone", 2.0)
    names = {folder_name(module, file) for module, file in kernels.items()}
    for k, name in enumerate(sorted(names) + [f"other-{age}" for age in range(5)]):
        (tmp_path / "numba" / name).mkdir(parents=True)
        os.utime(tmp_path / "numba" / name, (time.time() - 3600.0 * k,) * 2)
    monkeypatch.setattr(kernel_cache, "MOST_FOLDERS", len(names) + 2)
    remove_unused(tmp_path / "numba", kernels)
    assert {p.name for p in (tmp_path / "numba").iterdir()} == {*names, "other-0", "other-1"}


@cache
def reader_of_all() -> CodeReader:
    """What one variant reaches of the library the other one does, too: it is read once."""
    return CodeReader(Cache(None))


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("variant", "at_once"), [("dependent", False), ("essential", True)])
def test_kernels_that_few_blocks_need_are_compiled_when_one_does(variant: str, at_once: bool) -> None:
    path = PACKAGE.parent / "stages" / "relative_orientation" / f"{variant}.py"
    code = reader_of_all().code_of(f"aatri.stages.relative_orientation.{variant}", path)
    assert CONSENSUS in kernels_of([code])
    assert (CONSENSUS in kernels_of([code], at_once=True)) == at_once


def test_a_kernel_that_is_compiled_while_a_stage_is_made_is_told_once_and_how_long_it_took() -> None:
    numba = importlib.import_module("numba")
    told: list[tuple[int, int, str]] = []
    compile_s: list[tuple[float, float]] = []
    context = SimpleNamespace(progress=lambda *what: told.append(what))
    with worker._compilation_told(cast("LoggedContext", context), lambda *seconds: compile_s.append(seconds)):
        began_s = time.perf_counter()
        double = numba.njit(lambda x: 2.0 * x)
        numba.njit("float64(float64)")(lambda x: double(x) + 3.0)  # compiles the other within
        took_s = time.perf_counter() - began_s
        time.sleep(0.05)
    numba.njit("float64(float64)")(lambda x: x)
    assert told == [(0, 0, "compiling test_kernel_cache, once: this block is the first to need it")]
    assert len(compile_s) == 1
    assert 0 < compile_s[0][0] <= took_s
    assert compile_s[0][1] > 0


def test_seconds_of_a_stage_are_without_compiling(monkeypatch: pytest.MonkeyPatch) -> None:
    numba = importlib.import_module("numba")
    took_s: list[float] = []
    took_processor_s: list[float] = []

    def call(*_: object) -> object:
        began_s, began_processor_s = time.perf_counter(), time.process_time()
        numba.njit("float64(float64)")(lambda x: 2.0 * x)
        took_s.append(time.perf_counter() - began_s)
        took_processor_s.append(time.process_time() - began_processor_s)
        return SimpleNamespace(metrics=dict, offers=tuple)

    monkeypatch.setattr(worker, "_card", lambda _: SimpleNamespace(wants_rng=False))
    monkeypatch.setattr(worker, "_call", call)
    context = SimpleNamespace(progress=lambda *_: None, warnings=[])
    task = SimpleNamespace(use="role/variant", version=1, options={}, inputs={}, seed=0, parts={})
    _, record = worker._made(cast("Task", task), cast("LoggedContext", context), {}, "")
    assert record["seconds"] < took_s[0] / 2
    assert record["processor_seconds"] < took_processor_s[0] / 2


@pytest.mark.slow
def test_each_kernel_has_a_name_of_its_own_for_symbols_of_two_processes_are_linked_by_name() -> None:
    """Three loops called `add` of one signature, compiled by two processes, gave an elimination that was wrong."""
    files = [file for file in PACKAGE.glob("**/kernels/*.py") if file.stem != "__init__"]
    modules = [".".join(("aatri", *file.relative_to(PACKAGE).with_suffix("").parts)) for file in files]
    kernels = {id(v): v for m in modules for v in vars(importlib.import_module(m)).values() if hasattr(v, "py_func")}
    names = Counter((v.py_func.__module__, v.py_func.__qualname__) for v in kernels.values())
    assert len(names) > 100
    assert [name for name, count in names.items() if count > 1] == []


def test_no_kernel_fuses_products_with_sums_for_which_are_fused_depends_on_what_has_been_compiled() -> None:
    """A worker that found half of the kernels in the cache, and compiled the others, gave other last bits."""
    kernels = [file for file in PACKAGE.glob("**/kernels/*.py") if file.stem != "__init__"]
    assert len(kernels) > 30
    assert [file.name for file in kernels if "fastmath" in file.read_text()] == []


@pytest.mark.parametrize("module", ["kernel_cache", "compile_kernels"])
def test_numba_is_not_imported_before_the_variables_that_lead_it_to_the_cache_are_set(module: str) -> None:
    """It reads them once: imported before, it would keep what it compiles beside the code."""
    code = f"import sys, aatri.pipeline.methods.{module}; print('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
