"""Compiled kernels in the user's cache: a folder per kernel module, named by the digest of the code it reaches.

The same code is compiled once on a machine, for all its clones and environments; an edit leads to a new folder. A
folder that no run has used for `KEPT_DAYS` is removed.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import shutil
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from aatri.pipeline.methods.code_digest import PACKAGE, Code, CodeReader
from aatri.pipeline.store.cache import Cache, cache_folder, cache_name

VARIABLE = "NUMBA_CACHE_DIR"
LOCATORS = "NUMBA_CACHE_LOCATOR_CLASSES"

OTHERS = "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator,ZipCacheLocator"
"""Numba's own, for compiled functions of other libraries."""

KEPT_DAYS = 60
"""A folder is 0.2 MB; of an edited kernel some ten a day may come."""

INDEX = ".nbi"
"""Ending of the index file that Numba writes for each compiled function."""

_DAY_S = 86_400.0


def use_kernel_cache() -> Path | None:
    """Lead Numba to the compiled kernels; to be called before Numba is imported.

    Returns
    -------
    Path or None
        The folder; None if Numba is not installed.
    """
    if importlib.util.find_spec("numba") is None:
        return None
    folder = Path(os.environ.setdefault(VARIABLE, str(cache_folder() / "numba")))
    os.environ[LOCATORS] = f"aatri.pipeline.methods.kernel_locator.ByContent,{OTHERS}"
    return folder


@cache
def folder_name(module: str, file: Path) -> str:
    """Name of the folder of a kernel module: its name, and the digest of its text and of the code that it reaches."""
    digest = hashlib.sha256(code_of(module, file).digest.encode() + file.read_bytes()).hexdigest()[:16]
    return f"{module.removeprefix('aatri.').replace('.kernels', '')}-{digest}"


def is_compiled(module: str, file: Path) -> bool:
    """Whether all functions that a kernel module declares are in the cache, for some processor at least."""
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
    return CodeReader(Cache(cache_name("code", PACKAGE)))


def remove_unused(folder: Path, kernels: Mapping[str, Path]) -> None:
    """Mark the folders of some kernel modules as used today, and remove those that nobody has used for long."""
    now, names = time.time(), {folder_name(module, file) for module, file in kernels.items()}
    for one in folder.iterdir() if folder.is_dir() else ():
        with contextlib.suppress(OSError):
            age_s = now - one.stat().st_mtime
            if one.name in names and age_s > _DAY_S:
                os.utime(one)
            elif one.name not in names and age_s > KEPT_DAYS * _DAY_S:
                shutil.rmtree(one) if one.is_dir() and not one.is_symlink() else one.unlink()
