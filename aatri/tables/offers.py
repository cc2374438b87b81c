"""What an artifact offers to the stages that take it: observations, standard deviations, constraints, groupings.

A kind names what it may offer; an artifact says what of that it holds; a stage says what it uses
(`@stage(uses=...)`). What is offered and used by no stage of a pipeline had no effect: the pipeline compares the names
and refuses it, without knowing what they mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal

Nature = Literal["observation", "standard deviation", "constraint", "correction", "reduction", "check", "grouping"]
"""Unused, a check, a grouping and a reduction (what a frame would ask for) are a warning; all else is an error."""


@dataclass(frozen=True)
class Offer:
    """Something an artifact holds that is to have an effect."""

    name: str
    """As stages state it and `ignore` takes it: `exterior.angles_rad`, `geodetic:distance`."""
    nature: str
    """One of `Nature`."""
    what: str
    """In words, with file and columns: `12 observed attitudes (exterior.csv: a1, a2, a3)`."""
    where: str
    """`file:line` of the first, or empty."""
    bears_on: str
    """Kind of artifact it bears upon: a chain that makes none of that kind may leave it."""

    def plain(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)


def offer_from_plain(value: Mapping[str, Any]) -> Offer:
    """The offer that `Offer.plain` gave."""
    return Offer(*(str(value[field.name]) for field in fields(Offer)))


def is_known(name: str, names: frozenset[str]) -> bool:
    """Whether a kind may offer this name; `geodetic:*` stands for every `geodetic:...`."""
    return name in names or f"{name.partition(':')[0]}:*" in names


def covers(use: str, name: str) -> bool:
    """Whether a name of `ignore` means an offer: the same name, or its table."""
    return name == use or name.startswith((f"{use}.", f"{use}:"))


@dataclass(frozen=True)
class Need:
    """Something without which a stage cannot work."""

    port: str
    one_of: tuple[str, ...]
    """Names of what the port may offer; one of them has to be there."""
    what: str
    remedy: str
    """What is told where none is."""
    or_port: str = ""
    """A port that gives it too, where it is connected."""

    @staticmethod
    def from_plain(plain: Mapping[str, Any]) -> Need:
        """From what `dataclasses.asdict` gives, read back."""
        return Need(
            str(plain["port"]), tuple(plain["one_of"]), str(plain["what"]), str(plain["remedy"]), str(plain["or_port"])
        )
