"""Arguments that are one of a few names: of a name that is none the nearest is told; the shell completes them."""

from collections.abc import Callable
from enum import StrEnum
from typing import TypeVar

import typer

from aatri.ids import clipped, did_you_mean

Names = TypeVar("Names", bound=StrEnum)


def one_of(names: type[Names]) -> Callable[[str], Names]:
    """A parser of an argument that is one of some names.

    Parameters
    ----------
    names : type of StrEnum
    """

    def parse(text: str) -> Names:
        values = [name.value for name in names]
        if text not in values:
            raise typer.BadParameter(f"{clipped(text)!r} is none of {', '.join(values)}{did_you_mean(text, values)}")
        return names(text)

    return parse


def complete(names: type[StrEnum]) -> Callable[[str], list[str]]:
    """What the shell offers of the names."""
    return lambda incomplete: [name.value for name in names if name.value.startswith(incomplete)]


def listed(names: type[StrEnum]) -> str:
    """The names for the help."""
    return ", ".join(name.value for name in names)
