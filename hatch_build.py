"""What a wheel carries beside the sources: its kernels, compiled, so that the first run compiles nothing.

They fit the Python, Numba and system of the build, and x86-64 processors with AVX2 (`GENERIC` of
`aatri/pipeline/methods/kernel_cache.py`). Where something else is met they are left alone, and the first run compiles.
Building a wheel therefore needs what aatri needs at run time. It compiles what the cache of this machine has not, for a
minute at most; an editable installation does not.
"""

from __future__ import annotations

import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

COMPILE = (
    "import pathlib, sys; from aatri.pipeline.methods.compile_kernels import compile_all; "
    "compile_all(pathlib.Path(sys.argv[1]))"
)


class CompiledKernels(BuildHookInterface):  # type: ignore[type-arg]
    """Adds `aatri/compiled` to a wheel."""

    def dependencies(self) -> list[str]:
        """What the build needs; the front ends of pip and build name their hook, and an editable one needs nothing."""
        return [] if any("editable" in argument for argument in sys.argv) else self.metadata.core.dependencies

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, before the files of the wheel are collected."""
        if version != "standard" or platform.machine().lower() not in ("x86_64", "amd64"):
            return
        self._folder = tempfile.TemporaryDirectory()
        kernels = Path(self._folder.name) / "compiled"
        subprocess.run([sys.executable, "-c", COMPILE, str(kernels)], cwd=self.root, check=True)
        build_data["force_include"][str(kernels)] = "aatri/compiled"
