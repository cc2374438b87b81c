"""What the author of a stage imports: `stage`, `Options`, `Field`, `InputPath`, `Context`, `SILENT`, `Role`.

A stage is a plain function: artifacts in, one artifact out. Its signature is its declaration:

    @stage(version=1)
    def dependent(block: Block, image_points: ImagePoints, *,
                  options: DependentOptions = DependentOptions(), context: Context = SILENT) -> Models:

Positional arguments are ports, named as in the role; one with default None is optional. `options`, `context` and
`rng` are passed only where the signature asks for them. A folder of stages is a role; its `__init__.py` declares
`ROLE = Role(ports, kind)`, which every variant of the role keeps to.

`uses` states which of the observations, standard deviations, constraints and groupings that its ports offer the stage
uses: names, or a function of its options that gives them. What no stage of a pipeline uses is refused. `needs` states
without which of them it cannot work: a pipeline is refused as soon as a port is there that offers none of them.

    @stage(version=1, uses=("ground_points.xyz_m", "ground_points.covariance_m2"))
    @stage(version=1, uses=lambda options: ("exterior.position_m",) if options.use_positions else ())
"""

import inspect
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

from pydantic import AfterValidator, Field, ValidationInfo

from aatri.errors import PluginError
from aatri.ids import did_you_mean
from aatri.options import Options
from aatri.progress import SILENT, StageContext
from aatri.regular_file import wrong_path
from aatri.tables.offers import Need, is_known
from aatri.tables.schema import Artifact

__all__ = [
    "SILENT",
    "CodePath",
    "Context",
    "Field",
    "InputPath",
    "Need",
    "Options",
    "Port",
    "Role",
    "StageCard",
    "card_of",
    "stage",
]

P = ParamSpec("P")
T = TypeVar("T")

Uses = tuple[str, ...] | Callable[[Any], Iterable[str]]
"""What a stage uses: names, or a function of its options (None where it takes none)."""

Needs = tuple[Need, ...] | Callable[[Any], Iterable[Need]]
"""What a stage needs: needs, or a function of its options (None where it takes none)."""

Context = StageContext
"""What a running stage may talk to: `log`, `warn`, `progress`, and `checkpoint.save` and `load` of arrays."""


class InputFile:
    """Marks a path option whose content counts as input."""


class CodeFile(InputFile):
    """Marks a path option whose file is executed."""


def _from_project(path: Path, info: ValidationInfo) -> Path:
    base = (info.context or {}).get("base")
    full = _short(Path(base) / path) if base is not None else path
    if what := wrong_path(full):
        raise ValueError(what)
    return full


def _short(path: Path) -> Path:
    """A path without `..`, as messages show it: from the working folder if it is below, else whole."""
    if ".." not in path.parts or path.name == "..":
        return path
    folder, here = path.parent.resolve(), Path.cwd()
    return (folder.relative_to(here) if folder.is_relative_to(here) else folder) / path.name


def _permitted(path: Path, info: ValidationInfo) -> Path:
    context = info.context or {}
    if "base" in context and not context.get("runs_code"):
        raise ValueError("Python of the project, which is executed only with --local-plugins")
    return path


InputPath = Annotated[Path, AfterValidator(_from_project), InputFile()]
"""A file or folder to read; relative to pipeline.yaml. Its content is part of what the stage depends on."""

CodePath = Annotated[Path, AfterValidator(_from_project), AfterValidator(_permitted), CodeFile()]
"""A file of Python that the stage executes: an `InputPath` that a pipeline may name only under --local-plugins."""


@dataclass(frozen=True)
class Role:
    """A role: ports by name with the kind of artifact they take, and the kind that every variant returns."""

    ports: Mapping[str, type[Artifact]]
    kind: type[Artifact]


@dataclass(frozen=True)
class Port:
    """A port as a variant asks for it."""

    name: str
    kind: type[Artifact]
    optional: bool


@dataclass(frozen=True)
class StageCard:
    """All that is known of a variant without running it."""

    function: Callable[..., Artifact]
    role: str
    variant: str
    version: int
    ports: tuple[Port, ...]
    kind: type[Artifact]
    options: type[Options] | None
    wants_context: bool
    wants_rng: bool
    doc: str
    uses: Uses | None = None
    needs: Needs = ()

    def needed_with(self, options: Options | None) -> tuple[Need, ...]:
        """What the stage needs with these options."""
        return tuple(self.needs(options) if callable(self.needs) else self.needs)

    def used_with(self, options: Options | None) -> tuple[str, ...] | None:
        """What the stage uses with these options, sorted; None if it does not say.

        Raises
        ------
        PluginError
            If it names something that none of its ports offers.
        """
        if self.uses is None:
            return None
        stated = self.uses(options) if callable(self.uses) else self.uses
        if isinstance(stated, str):
            raise PluginError(f"uses is the text {stated!r}", where=self.name, remedy=f"write uses=({stated!r},)")
        offered = frozenset(name for port in self.ports for name in port.kind.offered_names())
        for name in stated:
            if not is_known(name, offered):
                raise PluginError(
                    f"uses {name!r}, which no port offers{did_you_mean(name, offered)}",
                    where=self.name,
                    remedy=f"its ports offer {', '.join(sorted(offered)) or 'nothing'}",
                )
        return tuple(sorted(set(stated)))

    @property
    def name(self) -> str:
        """`ROLE/VARIANT`."""
        return f"{self.role}/{self.variant}"


_SPECIAL = ("options", "context", "rng")


def stage(*, version: int, uses: Uses | None = None, needs: Needs = ()) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Declare a function to be a stage.

    Parameters
    ----------
    version : int
        A change makes earlier results stale.
    uses : tuple of str or callable, optional
        What it uses of the observations, standard deviations, constraints and groupings that its ports offer (names as
        in `aatri.artifacts.offers`), or a function of its options that gives them.
    needs : tuple of Need or callable, optional
        Without which of them it cannot work.
    """

    def declare(function: Callable[P, T]) -> Callable[P, T]:
        function.__aatri_version__ = version  # type: ignore[attr-defined]
        function.__aatri_uses__ = uses  # type: ignore[attr-defined]
        function.__aatri_needs__ = needs  # type: ignore[attr-defined]
        return function

    return declare


def card_of(function: Callable[..., Any], role: str) -> StageCard:
    """Read the card off a stage function.

    Raises
    ------
    PluginError
        If the function is not declared with `@stage` or its signature breaks the contract.
    """
    where = f"{function.__module__}.{function.__name__}"
    version = getattr(function, "__aatri_version__", None)
    if version is None:
        raise PluginError("not a stage", where=where, remedy="decorate it with @stage(version=1)")
    hints = typing.get_type_hints(function)
    kind = hints.get("return")
    if not (isinstance(kind, type) and issubclass(kind, Artifact)):
        raise PluginError(f"returns {kind}, not a kind of artifact", where=where)
    parameters = inspect.signature(function).parameters
    ports = tuple(_port(p, hints, where) for name, p in parameters.items() if name not in _SPECIAL)
    options = hints.get("options")
    if options is not None and not (isinstance(options, type) and issubclass(options, Options)):
        raise PluginError("options are not a model derived from aatri.plugin.Options", where=where)
    module_doc = inspect.getdoc(inspect.getmodule(function)) or ""
    return StageCard(
        function,
        role,
        function.__name__,
        version,
        ports,
        kind,
        options,
        "context" in parameters,
        "rng" in parameters,
        module_doc,
        getattr(function, "__aatri_uses__", None),
        getattr(function, "__aatri_needs__", ()),
    )


def _port(parameter: inspect.Parameter, hints: dict[str, Any], where: str) -> Port:
    hint = hints.get(parameter.name)
    optional = parameter.default is None
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        hint = next(k for k in typing.get_args(hint) if k is not type(None))
    if not (isinstance(hint, type) and issubclass(hint, Artifact)):
        raise PluginError(f"port {parameter.name!r} is {hint}, not a kind of artifact", where=where)
    return Port(parameter.name, hint, optional)
