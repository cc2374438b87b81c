"""A toy library of two kernel modules, one of which calls the other."""

from __future__ import annotations

from pathlib import Path

INNER = """from numba import njit


@njit("float64(float64)", cache=True)
def twice(x):
    return {factor} * x
"""
OUTER = """from numba import njit
from field.kernels.inner import twice


@njit("float64(float64)", cache=True)
def more(x):
    return twice(x) + 1.0
"""


def clone(folder: Path, factor: float) -> dict[str, Path]:
    """Write the library into a folder; its kernel modules with their files."""
    kernels = folder / "field" / "kernels"
    kernels.mkdir(parents=True)
    for empty in (kernels.parent / "__init__.py", kernels / "__init__.py"):
        empty.write_text("")
    (kernels / "inner.py").write_text(INNER.format(factor=factor))
    (kernels / "outer.py").write_text(OUTER)
    return {f"field.kernels.{name}": kernels / f"{name}.py" for name in ("inner", "outer")}
