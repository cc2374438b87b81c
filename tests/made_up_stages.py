"""Small made-up kinds and stages: numbers instead of blocks, so that tests of the pipeline need no photogrammetry."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from aatri.arrays import Float
from aatri.errors import ConvergenceError
from aatri.pipeline.methods.registry import Registry
from aatri.plugin import SILENT, Context, Field, InputPath, Options, Role, stage
from aatri.tables.schema import Artifact, Table, attribute, column, table


class Values(Table):
    """Numbers."""

    value: Float = column("f8", unit="m", doc="a number")


class Numbers(Artifact):
    """A list of numbers."""

    kind: ClassVar[str] = "Numbers"
    values: Values = table()

    def metrics(self) -> dict[str, float | int | None]:
        return {"points": len(self.values), "sigma0": float("nan")}


class Total(Artifact):
    """A sum."""

    kind: ClassVar[str] = "Total"
    total: float = attribute(doc="the sum")

    def metrics(self) -> dict[str, float | int | None]:
        return {"total": self.total, "sigma0": 1.5}


class Inner(Options):
    """Nested options."""

    depth: int = Field(1, ge=0, description="how deep")


class FixedOptions(Options):
    """Options of `fixed`."""

    count: int = Field(3, ge=1, le=9, description="how many numbers")
    shape: Literal["up", "down"] = Field("up", description="direction")
    inner: Inner = Inner()
    file: InputPath | None = Field(None, description="a file")


def _numbers(values: object) -> Numbers:
    return Numbers(values=Values(value=np.asarray(values, dtype=float)))


@stage(version=1)
def fixed(*, options: FixedOptions = FixedOptions(), context: Context = SILENT) -> Numbers:  # noqa: B008
    """Numbers from 1."""
    context.log(f"count is {options.count}")
    context.progress(1, 2, "counting")
    if options.count == 7:
        context.warn("seven is \x1b[31mmany")
    return _numbers(np.arange(1, options.count + 1))


@stage(version=1)
def random(*, rng: np.random.Generator) -> Numbers:
    """Random numbers."""
    return _numbers(rng.normal(size=3))


class AddOptions(Options):
    """Options of `add`."""

    offset: float = Field(0.0, description="added to the sum")


@stage(version=2)
def add(numbers: Numbers, more: Numbers | None = None, *, options: AddOptions = AddOptions()) -> Total:  # noqa: B008
    """The sum."""
    extra = 0.0 if more is None else float(more.values.value.sum())
    return Total(total=float(numbers.values.value.sum()) + extra + options.offset)


@stage(version=1)
def stubborn(numbers: Numbers, *, context: Context = SILENT) -> Total:
    """Does not converge."""
    context.log("trying")
    raise ConvergenceError("no convergence after 3 iterations", where="point 12", remedy="better start")


@stage(version=1)
def absent() -> Numbers:
    """Lacks its data."""
    raise ConvergenceError("nothing to read")


@stage(version=1)
def buggy(numbers: Numbers) -> Total:
    """Has a bug."""
    raise ZeroDivisionError("oh")


@stage(version=1)
def liar(numbers: Numbers) -> Total:
    """Returns something else."""
    return numbers  # type: ignore[return-value]


@stage(version=1)
def interrupted(numbers: Numbers) -> Total:
    """Is stopped by the user."""
    raise KeyboardInterrupt


@stage(version=1)
def stranger(figures: Numbers) -> Total:
    """Asks for a port that its role does not have."""
    return Total(total=0.0)


@stage(version=1)
def report_size(total: Total, *, numbers: Numbers) -> Numbers:
    """A role that closes circles."""
    return numbers


ROLES = {
    "source": Role(ports={}, kind=Numbers),
    "sum": Role(ports={"numbers": Numbers, "more": Numbers}, kind=Total),
    "loop": Role(ports={"total": Total, "numbers": Numbers}, kind=Numbers),
}
STAGES = {
    "source/fixed": fixed,
    "source/random": random,
    "source/absent": absent,
    "sum/add": add,
    "sum/stubborn": stubborn,
    "sum/buggy": buggy,
    "sum/liar": liar,
    "sum/interrupted": interrupted,
    "sum/stranger": stranger,
    "loop/report_size": report_size,
}


def made_up_registry(local: Path | None = None) -> Registry:
    """The registry of all of these."""
    roles = {name: lambda role=role: role for name, role in ROLES.items()}
    return Registry(roles, {name: lambda function=function: function for name, function in STAGES.items()})


def write_pipeline(folder: Path, stages: str, head: str = "run: out\nseed: 1\n") -> Path:
    """A pipeline file with these lines under `stages:`, which begin in line 4."""
    path = folder / "pipeline.yaml"
    path.write_text(f"{head}stages:\n{stages}", encoding="utf-8")
    return path
