"""A project of its own with eleven small stages wired like the chain of the demo: a campaign of thousands of runs.

Numbers instead of blocks: every stage adds up its inputs and an option. The engine is the one of any project, with
`--local-plugins`; only the time in stages is not.
"""

from __future__ import annotations

from pathlib import Path

INIT = """\
from aatri.plugin import Role
from ._numbers import Numbers

ROLE = Role(ports={name: Numbers for name in "abcde"}, kind=Numbers)
"""
NUMBERS = '''\
from dataclasses import dataclass
from typing import ClassVar
from aatri.arrays import Float
from aatri.tables.schema import Artifact, Table, column, table


class Values(Table):
    """Numbers."""
    value: Float = column("f8", unit="m", doc="a number")


class Numbers(Artifact):
    """A list of numbers."""
    kind: ClassVar[str] = "Numbers"
    values: Values = table()
'''
ADD = '''\
"""The sum."""
import numpy as np
from aatri.plugin import SILENT, Context, Field, Options, stage
from ._numbers import Numbers, Values


class AddOptions(Options):
    offset: float = Field(0.0, description="added")
    length: int = Field(100, ge=1, description="how many numbers")


@stage(version=1)
def add(a: Numbers | None = None, b: Numbers | None = None, c: Numbers | None = None, d: Numbers | None = None,
        e: Numbers | None = None, *, options: AddOptions = AddOptions(), context: Context = SILENT) -> Numbers:
    """The sum of what is given, element by element."""
    context.log(f"offset {options.offset}")
    total = np.arange(options.length) + options.offset
    for given in (a, b, c, d, e):
        if given is not None:
            total = total + np.resize(given.values.value, options.length)
    return Numbers(values=Values(value=total))
'''
WIRING = {
    "block": (),
    "interior": ("block",),
    "refined": ("block", "interior"),
    "models": ("block", "refined"),
    "strips": ("block", "models"),
    "absolute": ("block", "strips", "refined"),
    "strip_block": ("block", "refined", "strips", "models", "absolute"),
    "bundle": ("block", "refined", "strip_block"),
    "accuracy_absolute": ("block", "absolute"),
    "accuracy_strip_block": ("block", "strip_block"),
    "accuracy": ("block", "bundle"),
}


def write_project(folder: Path, head: str = "run: run\nseed: 1\n") -> Path:
    """Write the stages and the pipeline; the pipeline file."""
    role = folder / "stages" / "numbers"
    role.mkdir(parents=True)
    for name, text in (("__init__.py", INIT), ("_numbers.py", NUMBERS), ("add.py", ADD)):
        (role / name).write_text(text)
    lines = [
        f"  {stage}: {{use: numbers/add, from: {{{_ports(sources)}}}, with: {{offset: {k}.0}}}}"
        for k, (stage, sources) in enumerate(WIRING.items())
    ]
    path = folder / "pipeline.yaml"
    path.write_text(head + "stages:\n" + "\n".join(lines) + "\n")
    return path


def _ports(sources: tuple[str, ...]) -> str:
    return ", ".join(f"{port}: {source}" for port, source in zip("abcde", sources, strict=False))
