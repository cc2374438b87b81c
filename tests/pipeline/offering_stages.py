"""Made-up stages whose artifacts offer something, and others that use it or do not."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from aatri.pipeline.methods.registry import Registry
from aatri.plugin import SILENT, Context, Field, Need, Options, Role, stage
from aatri.tables.offers import Offer
from aatri.tables.schema import Artifact, attribute

OBSERVED = Offer("list.observed", "observation", "3 numbers (list.csv: x)", "list.csv:2", "Total")
GROUPED = Offer("list.group", "grouping", "2 groups (list.csv: group)", "", "Total")
FOR_OTHERS = Offer("list.other", "observation", "1 word (list.csv: w)", "list.csv:9", "Word")


class Offered(Artifact):
    """Offers as many of these as its count."""

    kind: ClassVar[str] = "List"
    count: int = attribute(doc="how many")

    def offers(self) -> tuple[Offer, ...]:
        return (OBSERVED, GROUPED, FOR_OTHERS)[: self.count]

    @classmethod
    def offered_names(cls) -> frozenset[str]:
        return frozenset({"list.observed", "list.group", "list.other", "list:*"})


class Total(Artifact):
    kind: ClassVar[str] = "Total"
    value: int = attribute(doc="value")


class OfferedOptions(Options):
    """Options of `given`."""

    count: int = Field(1, description="how many offers")


class CarefulOptions(Options):
    """Options of `careful`."""

    observed: bool = Field(True, description="use the numbers")


@stage(version=1, uses=())
def given(*, options: OfferedOptions = OfferedOptions(), context: Context = SILENT) -> Offered:  # noqa: B008
    """A list."""
    return Offered(count=options.count)


@stage(version=1, uses=lambda options: ("list.observed",) if options.observed else ())
def careful(numbers: Offered, *, options: CarefulOptions = CarefulOptions()) -> Total:  # noqa: B008
    """Says what it uses."""
    return Total(value=1)


NEED = Need("numbers", ("list.group", "list.other"), "neither groups nor words", "give groups")


@stage(version=1, uses=("list.observed", "list.group"), needs=lambda options: (NEED,) if options.observed else ())
def needy(numbers: Offered, *, options: CarefulOptions = CarefulOptions()) -> Total:  # noqa: B008
    """Says what it needs."""
    return Total(value=4)


@stage(version=1)
def mute(numbers: Offered) -> Total:
    """Does not say what it uses."""
    return Total(value=2)


@stage(version=1, uses=("list.obsreved",))
def misspelt(numbers: Offered) -> Total:
    """Uses what there is not."""
    return Total(value=3)


ROLES = {"source": Role(ports={}, kind=Offered), "sum": Role(ports={"numbers": Offered}, kind=Total)}
STAGES = {"source/given": given, "sum/careful": careful, "sum/mute": mute, "sum/needy": needy, "sum/misspelt": misspelt}


def offering_registry(local: Path | None = None) -> Registry:
    """The registry of all of these."""
    roles = {name: lambda role=role: role for name, role in ROLES.items()}
    return Registry(roles, {name: lambda function=function: function for name, function in STAGES.items()})
