"""Finds stages: the built-in ones under `aatri.stages`, and installed ones by entry points.

Names are `ROLE/VARIANT`. A built-in variant is the file `ROLE/VARIANT.py` with a function VARIANT; an installed one is
an entry point of the group `aatri.stages` with that name. A module is imported only when its variant is asked for.
"""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import importlib.util
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aatri.errors import PluginError
from aatri.ids import did_you_mean
from aatri.plugin import Role, StageCard, card_of

GROUP = "aatri.stages"


@dataclass(frozen=True)
class Registry:
    """Roles and variants by name; each is loaded when asked for. `origins` says where a variant comes from."""

    roles: Mapping[str, Callable[[], Role]]
    variants: Mapping[str, Callable[[], Callable[..., Any]]]
    origins: Mapping[str, str] = field(default_factory=dict)

    def role(self, name: str) -> Role:
        """The declaration of a role.

        Raises
        ------
        PluginError
            If there is no such role.
        """
        if name not in self.roles:
            hint = did_you_mean(name, self.roles) or f"; known are {', '.join(sorted(self.roles))}"
            raise PluginError(f"no role {name!r}{hint}", remedy="see `aatri stages`")
        return self.roles[name]()

    def card(self, name: str) -> StageCard:
        """The card of a variant, checked against its role.

        Raises
        ------
        PluginError
            If there is no such variant, it cannot be imported, or it breaks the contract of its role.
        """
        role_name = name.partition("/")[0]
        role = self.role(role_name)
        if name not in self.variants:
            known = sorted(v for v in self.variants if v.startswith(f"{role_name}/"))
            hint = did_you_mean(name, known) or (f"; known are {', '.join(known)}" if known else "; the role has none")
            raise PluginError(f"no stage {name!r}{hint}", remedy=f"see `aatri stages {role_name}`")
        card = card_of(self.variants[name](), role_name)
        _check(card, name, role)
        return card


def find_stages() -> Registry:
    """All stages that are installed.

    Raises
    ------
    PluginError
        If a name is met twice.
    """
    package = importlib.import_module(GROUP)
    roles: dict[str, Callable[[], Role]] = {}
    variants: dict[str, Callable[[], Callable[..., Any]]] = {}
    origins: dict[str, str] = {}
    for folder in pkgutil.iter_modules(package.__path__):
        if not folder.ispkg:
            continue
        roles[folder.name] = _role_loader(folder.name)
        path = Path(folder.module_finder.path) / folder.name  # type: ignore[union-attr]
        for module in pkgutil.iter_modules([str(path)]):
            if not module.name.startswith("_"):
                name = f"{folder.name}/{module.name}"
                variants[name] = _module_loader(folder.name, module.name)
                origins[name] = str(path / f"{module.name}.py")
    for point in importlib.metadata.entry_points(group=GROUP):
        if point.name in variants:
            raise PluginError(f"stage {point.name} is there twice: {origins[point.name]} and {point.value}",
                              remedy="uninstall one of them")  # fmt: skip
        variants[point.name] = _entry_point_loader(point)
        origins[point.name] = point.value
    return Registry(dict(sorted(roles.items())), dict(sorted(variants.items())), origins)


def first_line(registry: Registry, name: str) -> str:
    """First line of a variant's documentation; of a file without importing it."""
    origin = registry.origins.get(name, "")
    try:
        if origin.endswith(".py"):
            doc = ast.get_docstring(ast.parse(Path(origin).read_text(encoding="utf-8"))) or ""
        else:
            doc = registry.card(name).doc
    except (OSError, SyntaxError, PluginError) as error:
        return f"(broken: {str(error).splitlines()[0]})"
    return doc.strip().splitlines()[0] if doc.strip() else ""


def _role_loader(role: str) -> Callable[[], Role]:
    def load() -> Role:
        declared = getattr(_imported(f"{GROUP}.{role}"), "ROLE", None)
        if not isinstance(declared, Role):
            raise PluginError("declares no ROLE = Role(ports, kind)", where=f"{GROUP}.{role}")
        return declared

    return load


def _module_loader(role: str, variant: str) -> Callable[[], Callable[..., Any]]:
    def load() -> Callable[..., Any]:
        module = _imported(f"{GROUP}.{role}.{variant}")
        function: Callable[..., Any] | None = getattr(module, variant, None)
        if function is None:
            raise PluginError(f"has no function {variant}", where=f"{GROUP}.{role}.{variant}",
                              remedy="the stage function is named like its file")  # fmt: skip
        return function

    return load


def _entry_point_loader(point: importlib.metadata.EntryPoint) -> Callable[[], Callable[..., Any]]:
    def load() -> Callable[..., Any]:
        try:
            function: Callable[..., Any] = point.load()
        except Exception as error:
            raise PluginError(f"cannot be imported: {type(error).__name__}: {error}", where=point.value) from error
        return function

    return load


def _imported(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except PluginError:
        raise
    except Exception as error:
        raise PluginError(f"cannot be imported: {type(error).__name__}: {error}", where=module) from error


def _check(card: StageCard, name: str, role: Role) -> None:
    if card.name != name:
        raise PluginError(f"the function of {name} is named {card.variant}", remedy="name it like the variant")
    if card.kind is not role.kind:
        raise PluginError(f"{name} returns {card.kind.kind}; its role returns {role.kind.kind}")
    for port in card.ports:
        if port.name not in role.ports:
            hint = did_you_mean(port.name, role.ports) or f"; the role has {', '.join(role.ports) or 'no ports'}"
            raise PluginError(f"{name} asks for port {port.name!r}{hint}")
        if port.kind is not role.ports[port.name]:
            wanted = role.ports[port.name].kind
            raise PluginError(f"{name} takes {port.kind.kind} at port {port.name}; its role gives {wanted}")
