"""aatri: analytical aerial triangulation as a pipeline of swappable stages.

`aatri.run(PIPELINE)` brings a pipeline up to date, `aatri.open(RUN)` opens what was made, `aatri.block(...)` makes a
Block of arrays, `aatri.stage(NAME)` a method to be called, `aatri.to_dataframe(ARTIFACT, TABLE)` a DataFrame.
"""

from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "run": "run_pipeline",
    "open": "open_run",
    "block": "block_from",
    "stage": "stage_call",
    "to_dataframe": "to_dataframe",
}


def __getattr__(name: str) -> Any:
    """The public names, imported when they are asked for: `import aatri` itself loads nothing."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'aatri' has no attribute {name!r}")
    import importlib  # by name: the floors below do not reach the top through this file

    return getattr(importlib.import_module("aatri.api"), _PUBLIC[name])


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
