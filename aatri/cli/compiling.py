"""How many kernels are compiled: their files in the cache folder, of those that the sources declare."""

from __future__ import annotations

import os
from pathlib import Path

INDEX = ".nbi"
"""Ending of the index file that Numba writes for each compiled function."""


class Compiling:
    """Looks at the folder of compiled kernels and tells while their number grows."""

    def __init__(self) -> None:
        self._known = -1
        self._total = 0

    def told(self) -> str:
        """`compiling: 34 of 66 kernels ready` if there are more than at the last look; else empty."""
        folder = os.environ.get("NUMBA_CACHE_DIR")
        if not folder:
            return ""
        found = sum(1 for path in Path(folder).rglob(f"*{INDEX}"))
        before, self._known = self._known, found
        if before in (-1, found):
            return ""
        self._total = self._total or declared()
        return f"compiling: {min(found, self._total)} of {self._total} kernels ready"


def declared() -> int:
    """Functions that the sources of aatri have compiled."""
    import aatri

    package = Path(aatri.__file__).parent
    sources = [path.read_text(encoding="utf-8") for path in package.glob("**/kernels/*.py")]
    return sum(line.startswith("@njit") for text in sources for line in text.splitlines())
