"""The stages there are, by name: roles (`ROLE`) and variants (`ROLE/VARIANT`), each imported when it is asked for.

Where they come from is told in `discovery`. A name met twice is an error that names both places; the same file met
twice counts once. Whatever is asked for is checked against the contract of its role: the function is named like its
file and declared with `@stage`, its ports are those of the role, it returns the kind of the role, and its options are a
model derived from `Options`.
"""

import ast
import errno
import importlib
import inspect
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from aatri.errors import AatriError, PluginError, ResourceError
from aatri.ids import did_you_mean
from aatri.pipeline.methods import discovery
from aatri.pipeline.methods.discovery import Declaration, Origin
from aatri.plugin import Role, StageCard, card_of

_NO_MEMORY = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")
"""How the loader of libraries says so, which Python passes on as ImportError."""
_DATACLASS_TWICE = ("Cannot overwrite attribute __setattr__ in class", "non-frozen dataclass from a frozen one")
"""How `dataclasses` refuses to make one of a Table or Artifact once more."""
_OWN = "those of the project itself need --local-plugins"


@dataclass(frozen=True)
class Registry:
    """Roles and variants by name; each is loaded when asked for. `origins` says where both come from."""

    roles: Mapping[str, Callable[[], Role]]
    variants: Mapping[str, Callable[[], Callable[..., Any]]]
    origins: Mapping[str, Origin] = field(default_factory=dict)

    def role(self, name: str) -> Role:
        """The declaration of a role.

        Raises
        ------
        PluginError
            If there is no such role, or its folder does not declare it.
        """
        if name not in self.roles:
            hint = did_you_mean(name, self.roles) or f"; known are {', '.join(sorted(self.roles))}"
            raise PluginError(f"no role {name!r}{hint}", remedy=f"see `aatri stages`; {_OWN}")
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
            variants = self.variants_of(role_name)
            hint = did_you_mean(name, variants) or (
                f"; known are {', '.join(variants)}" if variants else "; the role has none"
            )
            raise PluginError(f"no stage {name!r}{hint}", remedy=f"see `aatri stages {role_name}`; {_OWN}")
        function = self.variants[name]()
        try:
            card = _card(function, role_name)
            _check(card, name, role)
        except PluginError as error:
            remedy = error.remedy or f"the contract of the role is {contract(role_name, role)}"
            raise PluginError(error.what, where=_place(function, self.origins.get(name)), remedy=remedy) from error
        return card

    def variants_of(self, role: str) -> list[str]:
        """Names of the variants of a role."""
        return sorted(name for name in self.variants if name.startswith(f"{role}/"))


def find_stages(local: Path | None = None) -> Registry:
    """All stages there are.

    Parameters
    ----------
    local : Path, optional
        A project's own folder of stages, `stages/` beside its pipeline.yaml. Its code runs.

    Raises
    ------
    PluginError
        If a name is met twice, or is none that a role or variant can have.
    """
    declarations = [*discovery.built_in(), *discovery.installed()]
    if local is not None:
        declarations += discovery.in_project(local)
    kept: dict[str, Declaration] = {}
    for one in sorted(declarations, key=lambda f: not f.declared):
        if not one.declared and one.name in kept:
            continue  # a folder with variants of a role that is declared elsewhere
        other = kept.setdefault(one.name, one)
        if other is not one and not other.origin.is_same(one.origin):
            raise PluginError(
                f"{'stage' if '/' in one.name else 'role'} {one.name} is there twice: {other.origin.where} and "
                f"{one.origin.where}",
                remedy="rename or remove one of them",
            )
    names = sorted(kept)
    roles = {n: partial(_loaded_role, kept[n], names) for n in names if "/" not in n}
    variants = {n: partial(_loaded_variant, kept[n].origin) for n in names if "/" in n}
    return Registry(roles, variants, {n: kept[n].origin for n in names})


def first_line(registry: Registry, name: str) -> str:
    """First line of a variant's documentation; of a file without importing it."""
    origin = registry.origins.get(name)
    try:
        if origin is not None and origin.file is not None:
            doc = ast.get_docstring(ast.parse(origin.file.read_text(encoding="utf-8"))) or ""
        else:
            doc = registry.card(name).doc
    except (OSError, SyntaxError, UnicodeError, PluginError) as error:
        return f"(broken: {str(error).splitlines()[0]})"
    return doc.strip().splitlines()[0] if doc.strip() else ""


def contract(name: str, role: Role) -> str:
    """A role as it is written: `(block: Block, models: Models) -> Strips`, with its name."""
    ports = ", ".join(f"{port}: {kind.kind}" for port, kind in role.ports.items())
    return f"{name}({ports}) -> {role.kind.kind}"


def _loaded_role(declaration: Declaration, names: Iterable[str]) -> Role:
    declared = getattr(_imported(declaration.origin), declaration.origin.attribute, None)
    if not isinstance(declared, Role):
        others = [n for n in names if "/" not in n and n != declaration.name]
        raise PluginError(
            f"declares no ROLE = Role(ports, kind){did_you_mean(declaration.name, others)}",
            where=declaration.origin.where,
            remedy="name the folder like the role its variants belong to, or declare a new role",
        )
    return declared


def _loaded_variant(origin: Origin) -> Callable[..., Any]:
    module = _imported(origin)
    function: Callable[..., Any] | None = getattr(module, origin.attribute, None)
    if not inspect.isroutine(function):
        stages = [n for n, v in vars(module).items() if hasattr(v, "__aatri_version__")]
        has = f"; it has {', '.join(stages)}" if stages else ""
        raise PluginError(
            f"has no function {origin.attribute}{has}",
            where=origin.where,
            remedy="the stage function is named like its file",
        )
    return function


def _imported(origin: Origin) -> Any:
    try:
        return importlib.import_module(origin.import_name)
    except PluginError:
        raise
    except Exception as error:
        raise _not_imported(origin, error) from error


def _not_imported(origin: Origin, error: Exception) -> AatriError:
    for cause in _causes(error):
        lacks = isinstance(cause, OSError) and cause.errno in (errno.ENOMEM, errno.EAGAIN)
        if isinstance(cause, MemoryError) or lacks or any(words in str(cause) for words in _NO_MEMORY):
            return ResourceError(f"no memory to import {origin.where}", remedy="a machine with more memory")
    remedy = "install what it imports" if isinstance(error, ModuleNotFoundError) else "correct or remove it"
    if isinstance(error, TypeError) and any(words in str(error) for words in _DATACLASS_TWICE):
        remedy = "a Table or Artifact is a dataclass by itself: take `@dataclass` off"
    what = f"cannot be imported: {type(error).__name__}: {error}"
    return PluginError(what, where=_line_of(error, origin), remedy=remedy)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _line_of(error: Exception, origin: Origin) -> str:
    """`file:line` of the plugin where importing it failed."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(origin.file)]
    if isinstance(error, SyntaxError) and error.filename == str(origin.file):
        lines.append(error.lineno)
    return f"{origin.file}:{lines[-1]}" if lines else origin.where


def _place(function: Callable[..., Any], origin: Origin | None) -> str:
    """`file:line` of a stage function."""
    code = getattr(inspect.unwrap(function), "__code__", None)
    if code is not None:
        return f"{code.co_filename}:{code.co_firstlineno}"
    return origin.where if origin else str(function)


def _card(function: Callable[..., Any], role: str) -> StageCard:
    try:
        return card_of(function, role)
    except (NameError, TypeError, AttributeError, SyntaxError) as error:
        raise PluginError(
            f"its annotations cannot be resolved: {type(error).__name__}: {error}",
            remedy="import their names at the top of the file, not under TYPE_CHECKING",
        ) from error


def _check(card: StageCard, name: str, role: Role) -> None:
    if card.name != name:
        raise PluginError(f"the function of {name} is named {card.variant}", remedy="name it like the variant")
    if not isinstance(card.version, int) or isinstance(card.version, bool) or card.version < 1:
        raise PluginError(f"version of {name} is {card.version!r}", remedy="a whole number from 1: @stage(version=1)")
    if "options" in inspect.signature(card.function).parameters and card.options is None:
        raise PluginError(f"options of {name} have no type", remedy="annotate them with a model derived from Options")
    if card.kind is not role.kind:
        raise PluginError(f"{name} returns {card.kind.kind}; its role returns {role.kind.kind}")
    for port in card.ports:
        if port.name not in role.ports:
            hint = did_you_mean(port.name, role.ports) or f"; the role has {', '.join(role.ports) or 'no ports'}"
            raise PluginError(f"{name} asks for port {port.name!r}{hint}")
        if port.kind is not role.ports[port.name]:
            kind_of_role = role.ports[port.name].kind
            raise PluginError(f"{name} takes {port.kind.kind} at port {port.name}; its role gives {kind_of_role}")
