"""Compiled kernels in the user's cache: a folder per kernel module, named by the digest of all that it follows from.

That is the code that the module reaches, Python, Numba and the processor. So the same code is compiled once on a
machine, for all its clones and environments; an edit leads to a new folder. A folder that no run has used for
`KEPT_DAYS` is removed, and of more than `MOST_FOLDERS` those that were used first.

Processors of x86-64 with AVX2 count as one, `GENERIC`, and run the same machine code; that for AVX-512 is not faster
here (docs/speed.md). So a wheel can carry the folders of such a processor (`hatch_build.py`): those that fit are copied
into the cache, as if they had been compiled there.
"""

import atexit
import contextlib
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from aatri.pipeline.methods.code_digest import PACKAGE, Code, CodeReader
from aatri.pipeline.store.cache import Cache, cache_folder, cache_name
from aatri.pipeline.store.inside import temporary_name

VARIABLE = "NUMBA_CACHE_DIR"
LOCATORS = "NUMBA_CACHE_LOCATOR_CLASSES"
PROCESSOR, FEATURES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"

OTHERS = "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator,ZipCacheLocator"
"""Numba's own, for compiled functions of other libraries."""

GENERIC = "x86-64-v3"
"""The processor of the x86-64 psABI that has AVX2 and fused multiply-add: Intel since 2013, AMD since 2015."""

_GENERIC_FLAGS = frozenset({"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"})
"""How Linux tells it."""

CARRIED = PACKAGE / "compiled"
"""Where a wheel carries compiled kernels."""

KEPT_DAYS, MOST_FOLDERS = 60, 1_000
"""A folder is some 0.5 MB; one clone needs some 50, and of an edited kernel some ten a day may come."""

INDEX = ".nbi"
"""Ending of the index file that Numba writes for each compiled function."""

_DAY_S = 86_400.0


def use_kernel_cache() -> Path | None:
    """Lead Numba to the compiled kernels; to be called before kernels are imported.

    Where the cache cannot be written compiled kernels are kept for this run only. Numba that has been imported before,
    as by a notebook, reads its variables anew; the processor stays the one that it has generated code for.

    Returns
    -------
    Path or None
        The folder; None if Numba is not installed.
    """
    if importlib.util.find_spec("numba") is None:
        return None
    chosen = bool(os.environ.keys() & {PROCESSOR, FEATURES}) or _has_generated_code()
    if not chosen and set(_described_processor().split()) >= _GENERIC_FLAGS:
        os.environ |= {PROCESSOR: GENERIC, FEATURES: ""}
    folder = Path(os.environ.get(VARIABLE) or cache_folder() / "numba")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="aatri-kernels-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[VARIABLE] = str(folder)
    os.environ[LOCATORS] = f"aatri.pipeline.methods.kernel_locator.ByContent,{OTHERS}"
    if "numba.core.config" in sys.modules:
        sys.modules["numba.core.config"].reload_config()
    return folder


def _has_generated_code() -> bool:
    """Whether Numba has a code generator in this process already; its processor cannot be changed any more."""
    registry = sys.modules.get("numba.core.registry")
    return registry is not None and "_toplevel_target_context" in vars(registry.cpu_target)


@cache
def folder_name(module: str, file: Path) -> str:
    """Name of the folder of a kernel module: its name, and the digest of all that its compiled code follows from."""
    parts = [code_of(module, file).digest, file.read_bytes().hex(), *_compiler()]
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]
    return f"{module.removeprefix('aatri.').replace('.kernels', '')}-{digest}"


@cache
def _compiler() -> tuple[str, ...]:
    """Compiler, system and processor; Numba looks again at its version and at the processor when it loads code."""
    versions = [importlib.metadata.version(name) for name in ("numba", "llvmlite")]
    named = [os.environ.get(name, _described_processor()) for name in (PROCESSOR, FEATURES)]
    return (*versions, sys.platform, platform.machine(), *named)


@cache
def _described_processor() -> str:
    """Name and features of the processor, as the system describes it."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").partition("\n\n")[0].splitlines()
        about = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
        return " ".join(about.get(key, "") for key in ("model name", "CPU part", "flags", "Features"))
    return platform.processor()


def is_compiled(module: str, file: Path) -> bool:
    """Whether all functions that a kernel module declares are in the cache."""
    folder = Path(os.environ[VARIABLE]) / folder_name(module, file)
    return len(list(folder.glob(f"*{INDEX}"))) >= declared(file) if folder.is_dir() else False


def declared(file: Path) -> int:
    """How many functions a kernel module compiles when it is imported."""
    return sum(line.startswith("@njit") for line in file.read_text(encoding="utf-8").splitlines())


@cache
def code_of(module: str, file: Path) -> Code:
    """The code that a kernel module reaches."""
    return _reader().code_of(module, file)


@cache
def _reader() -> CodeReader:
    return CodeReader(Cache(cache_name("codes", PACKAGE)))


def copy_compiled(kernels: Mapping[str, Path], source: Path, target: Path) -> None:
    """Copy the compiled code of kernel modules from one folder of such code into another, as far as it is there.

    So a run takes into the cache what a wheel carries (`CARRIED`), and a wheel what the cache has.
    """
    for name in {folder_name(module, file) for module, file in kernels.items()}:
        if (source / name).is_dir():
            copy = temporary_name(target / name)
            with contextlib.suppress(OSError):
                shutil.copytree(source / name, copy)
                copy.rename(target / name)  # fails where another process has been faster
            shutil.rmtree(copy, ignore_errors=True)


def remove_unused(folder: Path, kernels: Mapping[str, Path]) -> None:
    """Mark the folders of some kernel modules as used today; remove what is long unused, and the oldest of many."""
    now, names = time.time(), {folder_name(module, file) for module, file in kernels.items()}
    others = list[tuple[float, Path]]()
    for one in folder.iterdir() if folder.is_dir() else ():
        with contextlib.suppress(OSError):
            used_s = one.stat().st_mtime
            if one.name not in names:
                others.append((used_s, one))
            elif now - used_s > _DAY_S:
                os.utime(one)
    for k, (used_s, one) in enumerate(sorted(others, reverse=True), start=len(names)):
        with contextlib.suppress(OSError):
            if now - used_s > KEPT_DAYS * _DAY_S or k >= MOST_FOLDERS:
                shutil.rmtree(one) if one.is_dir() and not one.is_symlink() else one.unlink()
