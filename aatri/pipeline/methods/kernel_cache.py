"""Where compiled code is kept: a folder named by all that it depends on.

Numba's own cache looks at the file of a compiled function only, not at the functions which that one calls in other
files: after an edit there it would run old machine code. So its folder is named by the digest of all sources in
`kernels` folders, Numba's version and the processor; an edit in any of them leads to an empty folder.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
from collections.abc import Iterable
from pathlib import Path

from aatri.pipeline.methods.code_digest import PACKAGE
from aatri.pipeline.store.cache import cache_folder

VARIABLE = "NUMBA_CACHE_DIR"


def use_kernel_cache(plugin_folders: Iterable[Path] = ()) -> Path | None:
    """Lead Numba to the folder of the present kernels; to be called before any stage is imported.

    Parameters
    ----------
    plugin_folders : iterable of Path
        Folders of packages whose `kernels` folders count too.

    Returns
    -------
    Path or None
        The folder; None if Numba is not installed.
    """
    try:
        version = importlib.metadata.version("numba")
    except importlib.metadata.PackageNotFoundError:
        return None
    digest = hashlib.sha256(f"{version}\n{platform.python_version()}\n{_processor()}\n".encode())
    for path in _sources([PACKAGE, *plugin_folders]):
        digest.update(f"{path.parent.parent.name}/{path.name}\0".encode() + path.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    given = os.environ.get(VARIABLE)
    base = Path(given) if given else cache_folder() / "numba"
    base = base.parent if base.name.startswith("kernels-") else base  # set by the process that started this one
    folder = base / name
    os.environ[VARIABLE] = str(folder)
    return folder


def _sources(folders: Iterable[Path]) -> list[Path]:
    found = {path for folder in folders for path in folder.glob("**/kernels/*.py")}
    return sorted(found)


def _processor() -> str:
    """What the machine code was made for: the model and its instruction sets."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as file:
            lines = [line for line in file.read(8192).splitlines() if line.startswith(("model name", "flags"))]
    except OSError:
        lines = [platform.processor()]
    return platform.machine() + "".join(dict.fromkeys(lines))
