"""What the planner knows of a variant: plain data read off its card, so that planning imports no stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aatri.plugin import Role, StageCard


@dataclass(frozen=True)
class MethodPort:
    """A port as a variant asks for it: the kind of artifact and its schema version."""

    name: str
    kind: str
    schema: int
    optional: bool


@dataclass(frozen=True)
class Method:
    """A variant: what it takes and gives. `role_ports` are all ports of its role, with their kinds."""

    name: str
    version: int
    ports: tuple[MethodPort, ...]
    kind: str
    schema: int
    wants_rng: bool
    role_ports: Mapping[str, str]

    def plain(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)


def method_of(card: StageCard, role: Role) -> Method:
    """The method of a card."""
    needs = tuple(MethodPort(p.name, p.kind.kind, p.kind.schema_version, p.optional) for p in card.ports)
    ports = {name: kind.kind for name, kind in role.ports.items()}
    return Method(card.name, card.version, needs, card.kind.kind, card.kind.schema_version, card.wants_rng, ports)


def from_plain(value: Mapping[str, Any]) -> Method:
    """The method that `Method.plain` gave."""
    return Method(**{**value, "ports": tuple(MethodPort(**need) for need in value["ports"])})
