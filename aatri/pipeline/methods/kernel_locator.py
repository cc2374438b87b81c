"""Where Numba keeps a compiled function: in a folder named by the code of its module and of all that it calls.

Numba names its cache by the path of a file and stamps it by the content of that file alone: every clone and every
environment compiles again, and an edit of a called function in another file goes unnoticed. Here a module of a
`kernels` folder is known by the digest of the code it reaches (`code_digest`): equal code is compiled once, and any
edit leads to another folder. Processor and options of the compiler are part of Numba's own index.

Numba is led here by the variable NUMBA_CACHE_LOCATOR_CLASSES; see `kernel_cache`.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core import caching

from aatri.pipeline.methods.kernel_cache import VARIABLE, folder_name


class ByContent(caching._CacheLocator):
    """The place of one compiled function of a `kernels` folder."""

    def __init__(self, function: Callable[..., Any], file: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._folder = Path(os.environ[VARIABLE]) / folder_name(function.__module__, file)

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> ByContent | None:
        """The place of a function; None if it is no kernel, or the cache cannot be written."""
        file = Path(py_file)
        if not os.environ.get(VARIABLE) or file.parent.name != "kernels" or not file.is_file():
            return None
        place = cls(py_func, file)
        try:
            place.ensure_cache_path()
        except OSError:
            return None
        return place

    def ensure_cache_path(self) -> None:
        """Make the folder, and see that it can be written."""
        self._folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=self._folder).close()

    def get_cache_path(self) -> str:
        """The folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """State of the source: the folder's name says it."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        """What tells functions of one name in one file apart."""
        return str(self._line)
