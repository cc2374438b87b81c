"""What the author of a stage checks it with: `check_stage("ROLE/NAME")`."""

from typing import Any


def __getattr__(name: str) -> Any:
    """`check_stage`, found when it is asked for: it brings in the whole pipeline."""
    if name == "check_stage":
        from aatri.testing.check import check_stage

        return check_stage
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
